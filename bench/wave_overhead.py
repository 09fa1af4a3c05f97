#!/usr/bin/env python3
"""What a wave costs that holds few paths.

  bench/wave_overhead.py --work DIR [--write]

Gas of albedo one fills everything: each path collides in each wave until the last bounce, none ends by itself, so that all
waves of a frame hold the same number of paths. A wave's overhead is what it takes beyond its paths, each of them counted
as in waves of 65,536. --write puts the table into bench/RESULTS.md, between its marks.
"""
import argparse
import json
import os
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
MARKS = ('<!-- wave overhead -->', '<!-- /wave overhead -->')
SCENE = '''MakeNamedMedium "gas" "string type" "homogeneous" "rgb sigma_a" [ 0 0 0 ] "rgb sigma_s" [ 1 1 1 ] "float g" 0.3
MediumInterface "" "gas"
Camera "perspective"
WorldBegin
LightSource "point" "point3 from" [ 0 0 5 ]
Translate 0 0 -500
Shape "sphere" "float radius" 0.01
'''
SIZES = {1: '1x1', 10: '10x1', 100: '10x10', 1000: '40x25', 65536: '256x256'}
WANTED_US = 50


def seconds_a_wave(a, store, paths):
    """Of the best of several renders; and that all waves are as large."""
    report = os.path.join(a.work, 'report.json')
    depth = 20 if paths > 10000 else 400
    best = float('inf')
    for _ in range(a.repeat):
        subprocess.run([a.spillway, 'render', store, '-o', os.path.join(a.work, 'frame.exr'), '--spp', '1', '--no-roulette',
                        '--resolution', SIZES[paths], '--max-depth', str(depth), '--threads', str(a.threads), '--report',
                        report, '-q'], check=True)
        r = json.load(open(report))
        waves = [w['paths'] for w in r['waves']]
        if min(waves[:depth]) != paths:
            sys.exit(f'waves of {min(waves[:depth])} to {max(waves)} paths instead of {paths}')
        best = min(best, r['seconds'] / len(waves))
    return best


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--work', required=True)
    parser.add_argument('--spillway', default=os.path.join(HERE, '..', 'build', 'spillway'))
    parser.add_argument('--threads', type=int, default=2)
    parser.add_argument('--repeat', type=int, default=5)
    parser.add_argument('--write', action='store_true')
    a = parser.parse_args()
    os.makedirs(a.work, exist_ok=True)
    scene, store = os.path.join(a.work, 'gas.pbrt'), os.path.join(a.work, 'gas.store')
    with open(scene, 'w') as file:
        file.write(SCENE)
    subprocess.run([a.spillway, 'pack', scene, '-o', store, '-q'], check=True)
    us = {paths: 1e6 * seconds_a_wave(a, store, paths) for paths in SIZES}
    a_path = us[65536] / 65536
    lines = ['| paths a wave | us a wave | overhead, us |', '|---|---|---|']
    overheads = []
    for paths in SIZES:
        overhead = us[paths] - paths * a_path
        lines.append(f'| {paths:,} | {us[paths]:.0f} | {overhead:.0f} |' if paths < 65536 else f'| {paths:,} | {us[paths]:.0f} | |')
        if paths <= 1000:
            overheads.append(overhead)
    text = '\n'.join(lines)
    print(text)
    if a.write:
        path = os.path.join(HERE, 'RESULTS.md')
        before, rest = open(path).read().split(MARKS[0], 1)
        with open(path, 'w') as file:
            file.write(before + MARKS[0] + '\n' + text + '\n' + MARKS[1] + rest.split(MARKS[1], 1)[1])
    if max(overheads) > WANTED_US:
        sys.exit(f'{max(overheads):.0f} us of overhead, {WANTED_US} wanted')


if __name__ == '__main__':
    main()
