#!/usr/bin/env python3
"""The published scene volumetric-caustic: gas in a box, a lamp of 5 x 4 mm behind a ball of glass.

  pip install mitsuba numpy OpenEXR
  bench/volumetric_caustic.py SCENE.pbrt --work DIR [--published TungstenRender.exr] [--variant scalar_rgb]

1. Beside Mitsuba 3 (volpath), for which the scene is written here once more, and beside quadrature where one bounce makes
   the picture. What went through the glass is found by chance alone, once in ten million events, and then as bright as a
   picture: means are compared without the ball, or with a larger lamp of the same power; of the scene itself the medians
   of blocks over many seeds, which are free of that light and below the mean.
2. How the error of the caustic falls: what the pixels below the ball gather, over independent seeds, for lamps of the same
   power and 16, 4 and 1 times the size.
3. Beside the published picture, with the lamp 16 times as long and wide, so that its caustic is found: what the camera and
   the number of bounces must be for it.
"""
import argparse
import os
import re
import subprocess

import numpy as np
import OpenEXR

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
BLOCKS = 16
# Columns and rows of blocks that the ball, its shadow and the caustic leave alone.
OUTSIDE = np.array([[x >= 10 or y <= 3 or (x <= 2 and y <= 8) for x in range(BLOCKS)] for y in range(BLOCKS)])
# Rows that are not near the lamp.
BELOW = np.repeat(np.arange(BLOCKS) >= 5, BLOCKS).reshape(BLOCKS, BLOCKS)
POWER = np.array([541126.75, 381971.8, 127323.94])  # radiance of the scene's lamp


def load(path):
    channels = OpenEXR.File(path).channels()
    if 'RGB' in channels:
        return np.asarray(channels['RGB'].pixels, dtype=float)
    return np.stack([np.asarray(channels[c].pixels, dtype=float) for c in 'RGB'], axis=-1)


def blocks(picture):
    height, width, _ = picture.shape
    return (picture @ LUMINANCE).reshape(BLOCKS, height // BLOCKS, BLOCKS, width // BLOCKS).mean((1, 3))


def ours(a, store, edge, samples, seed, depth=7):
    out = os.path.join(a.work, 'ours.exr')
    subprocess.run([a.spillway, 'render', store, '-o', out, '--spp', str(samples), '--seed', str(seed), '--resolution',
                    f'{edge}x{edge}', '--max-depth', str(depth), '--threads', str(a.threads), '-q'], check=True)
    return load(out)


def mitsuba_scene(mi, edge, depth, times, ball, walls):
    T = mi.ScalarTransform4f

    def rgb(*values):
        return {'type': 'rgb', 'value': list(values)}

    def wall(to_world, *reflectance):
        return {'type': 'rectangle', 'to_world': to_world,
                'bsdf': {'type': 'twosided', 'bsdf': {'type': 'diffuse', 'reflectance': rgb(*(walls * r for r in reflectance))}}}

    grey = (0.725, 0.71, 0.68)
    gas = {'type': 'ref', 'id': 'gas'}
    lamp = T().translate([-0.005, 1.98, -0.03]) @ T().rotate([1, 0, 0], 90) @ T().scale([0.0025 * times, 0.002 * times, 1])
    scene = {
        'type': 'scene', 'integrator': {'type': 'volpath', 'max_depth': depth + 1},
        'gas': {'type': 'homogeneous', 'albedo': rgb(1, 1, 1), 'sigma_t': rgb(1, 1, 1), 'phase': {'type': 'isotropic'}},
        'floor': wall(T().rotate([1, 0, 0], -90), *grey),
        'ceiling': wall(T().translate([0, 2, 0]) @ T().rotate([1, 0, 0], 90), *grey),
        'back': wall(T().translate([0, 1, -1]), *grey),
        'right': wall(T().translate([1, 1, 0]) @ T().rotate([0, 1, 0], -90), 0.14, 0.45, 0.091),
        'left': wall(T().translate([-1, 1, 0]) @ T().rotate([0, 1, 0], 90), 0.63, 0.065, 0.05),
        'front': {'type': 'rectangle', 'to_world': T().translate([0, 1, 1]), 'bsdf': {'type': 'null'}, 'interior': gas},
        'ball': {'type': 'sphere', 'center': [-0.22827, 1.2, 0.152505], 'radius': 0.3, 'exterior': gas,
                 'bsdf': {'type': 'dielectric', 'int_ior': 1.5, 'ext_ior': 1.0}},
        'lamp': {'type': 'rectangle', 'to_world': lamp, 'exterior': gas,
                 'bsdf': {'type': 'diffuse', 'reflectance': rgb(0, 0, 0)},
                 'emitter': {'type': 'area', 'radiance': rgb(*(POWER / times**2).tolist())}},
        'sensor': {'type': 'perspective', 'fov': 19.5, 'to_world': T().look_at([0, 1, 6.8], [0, 1, 0], [0, 1, 0]),
                   'film': {'type': 'hdrfilm', 'width': edge, 'height': edge, 'rfilter': {'type': 'box'},
                            'pixel_format': 'rgb', 'component_format': 'float32'}},
    }
    if not ball:
        del scene['ball']
    return scene


def variation(a, name, times=1, ball=True, walls=1, camera=None, box=False):
    """The scene with a lamp of the same power so many times as long and wide, and more changes; packed."""
    half_x, half_z = 0.0025 * times, 0.002 * times
    corners = [(half_x, half_z), (-half_x, half_z), (-half_x, -half_z), (half_x, -half_z)]
    points = '  '.join(f'{-0.005 + x:.6f} 1.98 {-0.03 + z:.6f}' for x, z in corners)
    radiance = ' '.join(f'{l:.8g}' for l in POWER / times**2)
    text = re.sub(r'"rgb L" \[[^]]*\]', f'"rgb L" [ {radiance} ]', open(a.scene).read())
    text = re.sub(r'\[ -0\.0025 1\.98[^]]*\]', f'[ {points} ]', text)
    if not ball:
        text = re.sub(r'NamedMaterial "Sphere"\s+AttributeBegin.*?AttributeEnd', '', text, count=1, flags=re.DOTALL)
    if walls == 0:
        text = re.sub(r'("rgb reflectance" )\[[^]]*\]', r'\1[ 0 0 0 ]', text)
    if camera is not None:
        text = re.sub(r'0 -1\s+6\.8\s+1', f'0 -1 {camera} 1', text)
    if box:
        text = re.sub(r'PixelFilter "triangle"(\s+"float .radius" \[ 1 \]){2}',
                      'PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5', text)
    scene, store = (os.path.join(a.work, f'{name}.{kind}') for kind in ('pbrt', 'store'))
    with open(scene, 'w') as file:
        file.write(text)
    subprocess.run([a.spillway, 'pack', scene, '-o', store, '-q'], check=True)
    return store


def one_bounce(times, steps=96, lamp_steps=4, pixels=8):
    """What one bounce in the gas brings, of a lamp in front of black walls: along each ray the integral over the way and the
    lamp of sigma_s / (4 pi) L cos / d^2 exp(-sigma (way + d)); blocks of luminance."""
    g, w = np.polynomial.legendre.leggauss(lamp_steps)
    way, way_weight = np.polynomial.legendre.leggauss(steps)
    lamp = [((-0.005 + 0.0025 * times * g[i], 1.98, -0.03 + 0.002 * times * g[j]), w[i] * w[j] * 0.0025 * 0.002 * times**2)
            for i in range(lamp_steps) for j in range(lamp_steps)]
    edge = BLOCKS * pixels
    at = ((np.arange(edge) + 0.5) / edge * 2 - 1) * np.tan(np.radians(19.5 / 2))
    x, y = (c.ravel() for c in np.meshgrid(at, -at))
    with np.errstate(divide='ignore'):  # ways count in depth: from the window, at 5.8, to the walls
        end = np.minimum(7.8, np.minimum(1 / abs(x), 1 / abs(y)))
    z = 5.8 + (end - 5.8)[:, None] * (way + 1) / 2
    slant = np.sqrt(1 + x**2 + y**2)[:, None]
    bright = np.zeros_like(z)
    for (lx, ly, lz), area in lamp:
        squared = (x[:, None] * z - lx)**2 + (1 + y[:, None] * z - ly)**2 + (6.8 - z - lz)**2
        cosine = np.maximum(ly - 1 - y[:, None] * z, 0) / np.sqrt(squared)
        bright += area * cosine / squared * np.exp(-np.sqrt(squared))
    rays = (np.exp(-(z - 5.8) * slant) * bright * way_weight).sum(1) * slant[:, 0] * (end - 5.8) / 2 / (4 * np.pi)
    return rays.reshape(BLOCKS, pixels, BLOCKS, pixels).mean((1, 3)) * (POWER @ LUMINANCE) / times**2


def ratio_of_means(one, other, where):
    """Of the light of all blocks, with its standard error."""
    sums = [np.array([p[where].sum() for p in pictures]) for pictures in (one, other)]
    ratio = sums[0].mean() / sums[1].mean()
    error = np.hypot(*(s.std(ddof=1) / np.sqrt(len(s)) / s.mean() if len(s) > 1 else 0 for s in sums))
    return f'{ratio:.4f} +- {ratio * error:.4f}'


def ratio_of_medians(one, other, where):
    """Of the sums of the medians of blocks, with the deviation over drawing the pictures anew."""
    values = [np.array([p[where] for p in pictures]) for pictures in (one, other)]
    draws = np.random.default_rng(1)

    def ratio(picked):
        return np.median(picked[0], 0).sum() / np.median(picked[1], 0).sum()
    again = [ratio([v[draws.integers(0, len(v), len(v))] for v in values]) for _ in range(400)]
    return f'{ratio(values):.4f} +- {np.std(again):.4f}'


def beside_mitsuba(a):
    import mitsuba as mi
    mi.set_variant(a.variant)

    def both(name, edge, samples, seeds, depth, times=1, ball=True, walls=1):
        store = variation(a, name, times, ball, walls, box=True)
        scene = mi.load_dict(mitsuba_scene(mi, edge, depth, times, ball, walls))
        theirs = [blocks(np.array(mi.render(scene, spp=samples, seed=s + 1), dtype=float)) for s in range(seeds)]
        return [blocks(ours(a, store, edge, samples, s, depth)) for s in range(seeds)], theirs

    print('| | ours, of Mitsuba | |\n|---|---|---|')
    mine, theirs = both('one_bounce', 32, 4096, 8, depth=1, times=10, ball=False, walls=0)
    exact = [one_bounce(10)]
    print(f'| no ball, black walls, lamp of 50 x 40 mm, one bounce | {ratio_of_means(mine, theirs, BELOW)} | ours of quadrature '
          f'{ratio_of_means(mine, exact, BELOW)}, Mitsuba of quadrature {ratio_of_means(theirs, exact, BELOW)} |', flush=True)
    mine, theirs = both('no_ball', 64, 64, 64, depth=7, ball=False)
    print(f'| no ball, the scene\'s lamp, seven bounces | {ratio_of_means(mine, theirs, BELOW)} | |', flush=True)
    mine, theirs = both('large_lamp', 32, 1024, 16, depth=7, times=80)
    print(f'| all, lamp of 400 x 320 mm, seven bounces | {ratio_of_means(mine, theirs, OUTSIDE)} | below the ball, too: '
          f'{ratio_of_means(mine, theirs, BELOW)} |', flush=True)
    mine, theirs = both('all', 64, 64, 64, depth=7)
    print(f'| the scene, medians of 64 seeds | {ratio_of_medians(mine, theirs, OUTSIDE)} | sum of medians over sum of means: ours '
          f'{np.median(mine, 0)[OUTSIDE].sum() / np.mean(mine, 0)[OUTSIDE].sum():.2f}, '
          f'Mitsuba {np.median(theirs, 0)[OUTSIDE].sum() / np.mean(theirs, 0)[OUTSIDE].sum():.2f} |', flush=True)


def error_of_the_caustic(a):
    """Below the ball: rows 9 to 15 and columns 3 to 6 of the blocks."""
    edge = 32
    print('| lamp | samples a pixel | mean below the ball | relative deviation |\n|---|---|---|---|')
    for times in (16, 4, 1):
        store = variation(a, f'lamp{times}', times)
        counts, deviations = [], []
        for samples in (16, 64, 256, 1024):
            means = np.array([blocks(ours(a, store, edge, samples, 1000 + s))[9:16, 3:7].mean() for s in range(a.seeds)])
            counts.append(samples), deviations.append(means.std(ddof=1))
            print(f'| {5 * times} x {4 * times} mm | {samples} | {means.mean():.3f} | {deviations[-1] / means.mean():.3f} |',
                  flush=True)
        slope = np.polyfit(np.log(counts), np.log(deviations), 1)[0]
        print(f'{times}: {a.seeds} seeds, the deviation falls as the samples to the power {slope:.2f}')


def beside_the_published(a):
    """Without the blocks at the edge, which the border of the picture reaches, and those near the lamp."""
    theirs = blocks(load(a.published))
    inside = np.pad(np.ones((BLOCKS - 2, BLOCKS - 2), bool), 1) & BELOW
    for camera in (6.8, 7):
        store = variation(a, f'camera{camera}', times=16, camera=camera)
        for depth in (3, 4, 5, 7):
            mine = np.mean([blocks(ours(a, store, 64, 1024 if depth == 4 else 256, s, depth)) for s in range(8)], axis=0)
            for name, where in (('outside', inside & OUTSIDE), ('caustic and shadow', inside & ~OUTSIDE)):
                print(f'camera at {camera}, {depth} bounces, {name}: {mine[where].sum() / theirs[where].sum():.3f} times as '
                      f'bright as the published picture, correlation {np.corrcoef(mine[where], theirs[where])[0, 1]:.4f}',
                      flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('scene')
    parser.add_argument('--work', required=True)
    parser.add_argument('--published')
    parser.add_argument('--spillway', default=os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'build', 'spillway'))
    parser.add_argument('--seeds', type=int, default=10)
    parser.add_argument('--variant', default='llvm_ad_rgb', help="Mitsuba's")
    parser.add_argument('--threads', type=int, default=2)
    parser.add_argument('--only', choices=('mitsuba', 'error', 'published'))
    a = parser.parse_args()
    os.makedirs(a.work, exist_ok=True)
    if a.only in (None, 'mitsuba'):
        beside_mitsuba(a)
    if a.only in (None, 'error'):
        error_of_the_caustic(a)
    if a.published and a.only in (None, 'published'):
        beside_the_published(a)


if __name__ == '__main__':
    main()
