#!/usr/bin/env python3
"""The published scene volumetric-caustic: gas in a box, a lamp of 5 x 4 mm behind a ball of glass.

  pip install mitsuba numpy OpenEXR
  bench/volumetric_caustic.py SCENE.pbrt --work DIR [--published TungstenRender.exr]

1. Outside of the caustic, beside Mitsuba 3 (volpath), for which the scene is written here once more. The light that went
   through the glass is found by chance alone, once in ten million events, and then as bright as a picture: the medians of
   blocks over the seeds are free of it.
2. How the error of the caustic falls: what the pixels below the ball gather, over independent seeds, for lamps of the same
   power and 16, 4 and 1 times the size.
3. Beside the published picture: what the camera and the number of bounces must be for it.
"""
import argparse
import os
import re
import subprocess
import sys

import numpy as np
import OpenEXR

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
BLOCKS = 16
# Columns and rows of blocks that the ball, its shadow and the caustic leave alone.
OUTSIDE = [(y, x) for y in range(BLOCKS) for x in range(BLOCKS) if x >= 10 or y <= 3 or (x <= 2 and y <= 8)]


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


def mitsuba_scene(mi, edge):
    T = mi.ScalarTransform4f

    def rgb(*values):
        return {'type': 'rgb', 'value': list(values)}

    def wall(to_world, *reflectance):
        return {'type': 'rectangle', 'to_world': to_world,
                'bsdf': {'type': 'twosided', 'bsdf': {'type': 'diffuse', 'reflectance': rgb(*reflectance)}}}

    grey = (0.725, 0.71, 0.68)
    gas = {'type': 'ref', 'id': 'gas'}
    lamp = T().translate([-0.005, 1.98, -0.03]) @ T().rotate([1, 0, 0], 90) @ T().scale([0.0025, 0.002, 1])
    return {
        'type': 'scene', 'integrator': {'type': 'volpath', 'max_depth': 8},
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
                 'emitter': {'type': 'area', 'radiance': rgb(541126.75, 381971.8, 127323.94)}},
        'sensor': {'type': 'perspective', 'fov': 19.5, 'to_world': T().look_at([0, 1, 6.8], [0, 1, 0], [0, 1, 0]),
                   'film': {'type': 'hdrfilm', 'width': edge, 'height': edge, 'rfilter': {'type': 'tent', 'radius': 1},
                            'pixel_format': 'rgb', 'component_format': 'float32'}},
    }


def outside_of_the_caustic(a, store):
    import mitsuba as mi
    mi.set_variant('scalar_rgb')
    edge, samples = 64, 64
    scene = mi.load_dict(mitsuba_scene(mi, edge))
    theirs = [blocks(np.array(mi.render(scene, spp=samples, seed=s), dtype=float)) for s in range(a.seeds)]
    mine = [blocks(ours(a, store, edge, samples, s)) for s in range(a.seeds)]

    def median(pictures):
        values = np.array([[p[b] for b in OUTSIDE] for p in pictures])
        spread = np.percentile(values, 84, axis=0) - np.percentile(values, 16, axis=0)
        return np.median(values, axis=0), 1.253 * spread / 2 / np.sqrt(len(pictures))  # of a median of normal numbers

    (m, m_error), (t, t_error) = median(mine), median(theirs)
    off = (m - t) / np.hypot(m_error, t_error)
    print(f'outside of the caustic: {len(OUTSIDE)} blocks, {a.seeds} seeds of {samples} samples at {edge} x {edge}; sum of '
          f'medians {m.sum() / t.sum():.4f} of Mitsuba\'s, within {np.hypot(np.linalg.norm(m_error), np.linalg.norm(t_error)) / t.sum():.4f}; '
          f'{np.mean(abs(off) < 2):.2f} of the blocks within two standard errors, the worst {abs(off).max():.1f}; '
          f'correlation {np.corrcoef(m, t)[0, 1]:.4f}')


def scene_with_a_lamp(a, times):
    """The same power from a lamp so many times as long and as wide."""
    half_x, half_z = 0.0025 * times, 0.002 * times
    corners = [(half_x, half_z), (-half_x, half_z), (-half_x, -half_z), (half_x, -half_z)]
    points = '  '.join(f'{-0.005 + x:.6f} 1.98 {-0.03 + z:.6f}' for x, z in corners)
    radiance = ' '.join(f'{l / times**2:.6g}' for l in (541126.75, 381971.8, 127323.94))
    text = re.sub(r'"rgb L" \[[^]]*\]', f'"rgb L" [ {radiance} ]', open(a.scene).read())
    text = re.sub(r'\[ -0\.0025 1\.98[^]]*\]', f'[ {points} ]', text)
    scene, store = (os.path.join(a.work, f'lamp{times}.{kind}') for kind in ('pbrt', 'store'))
    with open(scene, 'w') as file:
        file.write(text)
    subprocess.run([a.spillway, 'pack', scene, '-o', store, '-q'], check=True)
    return store


def error_of_the_caustic(a):
    """Below the ball: rows 9 to 15 and columns 3 to 6 of the blocks."""
    edge = 32
    print('| lamp | samples a pixel | mean below the ball | relative deviation |\n|---|---|---|---|')
    for times in (16, 4, 1):
        store = scene_with_a_lamp(a, times)
        counts, deviations = [], []
        for samples in (16, 64, 256, 1024):
            means = np.array([blocks(ours(a, store, edge, samples, 1000 + s))[9:16, 3:7].mean() for s in range(a.seeds)])
            counts.append(samples), deviations.append(means.std(ddof=1))
            print(f'| {5 * times} x {4 * times} mm | {samples} | {means.mean():.3f} | {deviations[-1] / means.mean():.3f} |',
                  flush=True)
        slope = np.polyfit(np.log(counts), np.log(deviations), 1)[0]
        print(f'{times}: {a.seeds} seeds, the deviation falls as the samples to the power {slope:.2f}')


def beside_the_published(a):
    picture = blocks(load(a.published))
    theirs = np.array([picture[b] for b in OUTSIDE])
    text = open(a.scene).read()
    for z in (6.8, 7.0):
        scene, store = (os.path.join(a.work, f'{z}.{kind}') for kind in ('pbrt', 'store'))
        with open(scene, 'w') as file:
            file.write(re.sub(r'0 -1\s+6\.8\s+1', f'0 -1 {z} 1', text))
        subprocess.run([a.spillway, 'pack', scene, '-o', store, '-q'], check=True)
        for depth in (3, 4, 5, 7):
            seeds = [blocks(ours(a, store, 64, 64, s, depth)) for s in range(a.seeds)]
            mine = np.median([[p[b] for b in OUTSIDE] for p in seeds], axis=0)
            print(f'camera at {z}, {depth} bounces: {mine.sum() / theirs.sum():.2f} times as bright as the published '
                  f'picture, correlation {np.corrcoef(mine, theirs)[0, 1]:.3f}', flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('scene')
    parser.add_argument('--work', required=True)
    parser.add_argument('--published')
    parser.add_argument('--spillway', default=os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'build', 'spillway'))
    parser.add_argument('--seeds', type=int, default=16)
    parser.add_argument('--threads', type=int, default=2)
    parser.add_argument('--only', choices=('outside', 'error', 'published'))
    a = parser.parse_args()
    os.makedirs(a.work, exist_ok=True)
    store = os.path.join(a.work, 'scene.store')
    packed = subprocess.run([a.spillway, 'pack', a.scene, '-o', store, '-q'])
    if packed.returncode != 0:
        sys.exit('the scene was not packed')
    if a.only in (None, 'outside'):
        outside_of_the_caustic(a, store)
    if a.only in (None, 'error'):
        error_of_the_caustic(a)
    if a.published and a.only in (None, 'published'):
        beside_the_published(a)


if __name__ == '__main__':
    main()
