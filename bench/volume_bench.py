#!/usr/bin/env python3
"""A cloud whose bricks are four times their share of memory, beside the same cloud in memory.

  bench/volume_bench.py --work DIR [--write]

The cloud is a city generator's without a city: a .vdb file. It fills the picture, before a sky and under a sun, and
scatters up to 64 times. Rendered with all bricks in memory and with a quarter of them, in turns; the best of each counts,
and the picture must be the same. Bricks are read with direct I/O. --write puts the table into bench/RESULTS.md, between
its marks.
"""
import argparse
import json
import os
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
MIB = 1 << 20
MARKS = ('<!-- volumes -->', '<!-- /volumes -->')
SCENE = '''MakeNamedMedium "cloud" "string type" "openvdb" "string filename" "air.vdb" "string densityname" "air"
  "rgb sigma_a" [ 0.002 0.002 0.002 ] "rgb sigma_s" [ 0.998 0.998 0.998 ] "float g" 0.5
MediumInterface "cloud" "cloud"
Scale -1 1 1
LookAt 110 -60 90  110 320 108  0 0 1
Camera "perspective" "float fov" [ 44 ]
Film "rgb" "integer xresolution" [ 640 ] "integer yresolution" [ 360 ]
Sampler "sobol" "integer pixelsamples" [ 8 ]
Integrator "volpath" "integer maxdepth" [ 64 ]
WorldBegin
LightSource "infinite" "rgb L" [ 0.4 0.55 0.9 ]
LightSource "distant" "rgb L" [ 4 3.6 3 ] "point3 from" [ -0.6 -0.5 0.6 ] "point3 to" [ 0 0 0 ]
Material "diffuse" "rgb reflectance" [ 0.3 0.3 0.3 ]
Shape "trianglemesh" "point3 P" [ -900 -900 0  900 -900 0  900 900 0  -900 900 0 ]
  "integer indices" [ 0 1 2 0 2 3 ]
'''


def run(*command):
    print('  ' + ' '.join(map(str, command)), file=sys.stderr)
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode not in (0, 4):
        sys.exit(f'{" ".join(map(str, command))}\nended with {done.returncode}: {done.stderr}')


def make_store(a):
    store = os.path.join(a.work, 'cloud.store')
    if not os.path.exists(os.path.join(store, 'manifest.spw')):
        os.makedirs(a.work, exist_ok=True)
        run(a.spillway, 'city', '-o', a.work, '--buildings', 0, '--terrain', 'flat', '--fog=cloud', '--fog-cells', a.cells,
            '-q')
        with open(os.path.join(a.work, 'cloud.pbrt'), 'w') as file:
            file.write(SCENE)
        run(a.spillway, 'pack', os.path.join(a.work, 'cloud.pbrt'), '-o', store, '-q')
    return store


def render(a, store, *more):
    report = os.path.join(a.work, 'report.json')
    run(a.spillway, 'render', store, '-o', os.path.join(a.work, 'frame.exr'), '--spp', a.spp, '--resolution',
        a.resolution, '--threads', a.threads, '--direct-io', '--report', report, '-q', *more)
    return json.load(open(report))


def row(name, r, base):
    track, v = r['stages']['track_media'], r['volumes']
    return [name, f'{r["seconds"]:.1f}', f'{r["seconds"] / base:.2f}', f'{track["seconds"]:.1f}', f'{len(r["waves"])}',
            f'{track["rounds"]}', f'{v["bytes_read"] / MIB:.0f}', f'{v["bytes_read"] / max(1, v["unique_bytes"]):.1f}',
            f'{v["wait_seconds"]:.1f}', r['image_hash'][:8]]


def table(a, bricks, resident, swept):
    head = ['', 'seconds', 'of resident', 'in media', 'waves', 'rounds', 'MiB read', 'times each', 'seconds waited', 'image']
    base = resident['seconds']
    rows = [row('all bricks in memory', resident, base),
            row(f'a quarter of them ({bricks // 4 / MIB:.1f} MiB)', swept, base)]
    lines = ['| ' + ' | '.join(head) + ' |', '|' + '---|' * len(head)] + ['| ' + ' | '.join(r) + ' |' for r in rows]
    said = (f'`bench/volume_bench.py`: {bricks / MIB:.1f} MiB of bricks, {a.resolution}, {a.spp} samples a pixel, '
            f'{a.threads} threads, direct I/O; best of {a.repeat}, in turns.')
    return said + '\n\n' + '\n'.join(lines)


def write(text):
    path = os.path.join(HERE, 'RESULTS.md')
    with open(path) as file:
        results = file.read()
    if MARKS[0] not in results:
        results += f'\n## Clouds out of core\n\n{MARKS[0]}\n{MARKS[1]}\n'
    before, rest = results.split(MARKS[0], 1)
    with open(path, 'w') as file:
        file.write(before + MARKS[0] + '\n' + text + '\n' + MARKS[1] + rest.split(MARKS[1], 1)[1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--work', required=True)
    parser.add_argument('--spillway', default=os.path.join(HERE, '..', 'build', 'spillway'))
    parser.add_argument('--cells', default=160, help='of the cloud, along its radius: more make more bricks')
    parser.add_argument('--resolution', default='640x360')
    parser.add_argument('--spp', default=8)
    parser.add_argument('--threads', default=2)
    parser.add_argument('--repeat', type=int, default=3)
    parser.add_argument('--write', action='store_true')
    a = parser.parse_args()
    store = make_store(a)
    bricks = os.path.getsize(os.path.join(store, 'volumes.bricks'))
    kinds = {'resident': [], 'swept': []}
    for _ in range(a.repeat):
        kinds['resident'].append(render(a, store))
        kinds['swept'].append(render(a, store, '--volume-share', bricks // 4))
    hashes = {r['image_hash'] for runs in kinds.values() for r in runs}
    resident, swept = (min(kinds[k], key=lambda r: r['seconds']) for k in ('resident', 'swept'))
    text = table(a, bricks, resident, swept)
    print(text)
    if len(hashes) != 1:
        sys.exit(f'the pictures differ: {hashes}')
    if swept['volumes']['bytes_read'] <= swept['volumes']['unique_bytes']:
        sys.exit('the share was no limit: every brick was read once')
    if a.write:
        write(text)
    if swept['seconds'] > 1.5 * resident['seconds']:
        sys.exit('more than 1.5 times the resident one')


if __name__ == '__main__':
    main()
