#!/usr/bin/env python3
"""Choosing lights in a night city: error at equal time by tree, by power and uniformly, against the number of lights.

  bench/light_selection.py --work DIR [--counts 1,100,10000,1000000] [--write]

One city, seen from its street by night under moon and sky, its own lamps and windows put out; so many triangles hang in
their place, spread over the streets and roofs around the camera, alike in brightness, a part of the sky that does not
change. `spillway lab` measures each (axis light-selection), `light_bench --costs-only` what one selection takes. The
errors compared are those at the time that the tree takes for its largest number of samples but one, on straight lines
through what was measured (logarithms of both). Scenes with few lights have no tree: there `tree` is by power. --write puts the tables into
bench/RESULTS.md, between their marks, with a chart.
"""
import argparse
import csv
import math
import os
import re
import struct
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import chart  # noqa: E402

MARKS = ('<!-- light_selection -->', '<!-- /light_selection -->')
WAYS = ('tree', 'power', 'uniform')
SIDE = 0.25  # of a lamp, in distances between neighbours: lamps are alike in brightness, however many
ABOVE_EYE = 1.5  # metres
RADIANT_EXITANCE = 2  # of the lamps together, a square metre of ground
MOST_METRES = 250  # from the camera to the furthest lamp, along x and y
METRES_A_LAMP = 12  # between neighbours, where they are few


def run(*command):
    print('  ' + ' '.join(map(str, command)), file=sys.stderr)
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f'{" ".join(map(str, command))}\nended with {done.returncode}: {done.stdout}{done.stderr}')
    return done.stdout


def fraction(index, base):
    """The radical inverse: points of a Halton sequence are spread evenly however many are taken."""
    value, share = 0.0, 1.0
    while index:
        share /= base
        value += share * (index % base)
        index //= base
    return value


def lamp_places(count, eye, target):
    """Around the camera; a single one ahead of it."""
    if count == 1:
        along = [t - e for t, e in zip(target[:2], eye[:2])]
        size = math.hypot(*along)
        return [(eye[0] + 15 * along[0] / size, eye[1] + 15 * along[1] / size)], METRES_A_LAMP
    half = min(MOST_METRES, METRES_A_LAMP * math.sqrt(count) / 2)
    places = [(eye[0] + half * (2 * fraction(i, 2) - 1), eye[1] + half * (2 * fraction(i, 3) - 1))
              for i in range(1, count + 1)]
    return places, 2 * half / math.sqrt(count)


def write_lamps(path, places, z, side):
    """Triangles that face down, binary PLY."""
    head = (f'ply\nformat binary_little_endian 1.0\nelement vertex {3 * len(places)}\nproperty float x\n'
            f'property float y\nproperty float z\nelement face {len(places)}\n'
            'property list uchar int vertex_indices\nend_header\n')
    with open(path, 'wb') as file:
        file.write(head.encode())
        for x, y in places:
            file.write(struct.pack('<9f', x, y, z, x, y + side, z, x + side, y, z))
        for i in range(len(places)):
            file.write(struct.pack('<B3i', 3, 3 * i, 3 * i + 1, 3 * i + 2))


def without_lights(text):
    """AreaLightSource lines left out; what emitted is a surface."""
    return ''.join(line for line in text.splitlines(True) if not line.startswith('AreaLightSource'))


def numbers(text):
    return [float(word) for word in text.split()]


def make_scene(city, count):
    """A scene beside the city's own files, in it the lamps alone shine."""
    text = open(os.path.join(city, 'city.pbrt')).read()
    view = numbers(re.search(r'LookAt (.*)', text).group(1))
    places, spacing = lamp_places(count, view[0:3], view[3:6])
    write_lamps(os.path.join(city, f'lamps_{count}.ply'), places, view[2] + ABOVE_EYE, SIDE * spacing)
    for part in ('objects', 'geometry'):
        with open(os.path.join(city, f'{part}_dark.pbrt'), 'w') as file:
            file.write(without_lights(open(os.path.join(city, f'{part}.pbrt')).read()))
    head = text[:text.index('Include')]  # the view, the moon and the sky
    radiance = RADIANT_EXITANCE / (math.pi * SIDE * SIDE / 2)
    path = os.path.join(city, f'lamps_{count}.pbrt')
    with open(path, 'w') as file:
        file.write(head + 'Include "materials.pbrt"\nInclude "objects_dark.pbrt"\nInclude "geometry_dark.pbrt"\n'
                   'Include "instances.pbrt"\nMaterial "diffuse" "rgb reflectance" [ 0 0 0 ]\n'
                   f'AreaLightSource "diffuse" "rgb L" [ {radiance} {radiance} {radiance} ]\n'
                   f'Shape "plymesh" "string filename" "lamps_{count}.ply"\n')
    return path


def curves(folder):
    """{way: [(seconds, root of relMSE, samples)]} of the axis."""
    points = {}
    with open(os.path.join(folder, 'summary.csv')) as file:
        for row in csv.DictReader(file):
            if row['axis'] == 'light-selection':
                points.setdefault(row['configuration'], []).append(
                    (float(row['seconds']), math.sqrt(max(1e-12, float(row['rel_mse']))), int(row['spp'])))
    return {way: sorted(p) for way, p in points.items()}


def error_at(points, seconds):
    """On the line between the two nearest, or beyond the last."""
    logs = [(math.log(t), math.log(e)) for t, e, _ in points]
    at = math.log(seconds)
    i = max(0, min(len(logs) - 2, sum(1 for t, _ in logs if t < at) - 1))
    (t0, e0), (t1, e1) = logs[i], logs[i + 1]
    return math.exp(e0 + (e1 - e0) * (at - t0) / (t1 - t0))


def selection_costs(a, store):
    """{way: ns}; empty where there is no tree."""
    done = subprocess.run([a.light_bench, store, '--costs-only', '--receivers', '200'], capture_output=True, text=True)
    return {m[0]: float(m[1]) for m in re.findall(r'^(\w+) +(\d+) ns a selection', done.stdout, re.M)}


def measure(a, city, count):
    scene = make_scene(city, count)
    store, lab = os.path.join(a.work, f'lamps_{count}.store'), os.path.join(a.work, f'lab_{count}')
    run(a.spillway, 'pack', scene, '-o', store, '-q')
    run(a.spillway, 'lab', store, '-o', lab, '--axis', 'light-selection', '--spp', a.spp, '--seeds', a.seeds,
        '--reference-spp', a.reference_spp, '--resolution', a.resolution, '--max-depth', a.max_depth, '-q')
    of = curves(lab)
    seconds = of['tree' if 'tree' in of else 'power'][-2][0]
    errors = {way: error_at(points, seconds) for way, points in of.items()}
    return {'count': count, 'seconds': seconds, 'errors': errors, 'costs': selection_costs(a, store)}


def table(head, rows):
    return ['| ' + ' | '.join(row) + ' |' for row in [head, ['---'] * len(head), *rows]]


def report(a, results):
    rows = []
    for r in results:
        errors = [f'{r["errors"][way]:.4f}' if way in r['errors'] else '' for way in WAYS]
        best = r['errors'].get('tree', r['errors']['power'])
        times = [f'{(r["errors"][way] / best) ** 2:.1f}' if way in r['errors'] else '' for way in WAYS[1:]]
        costs = [f'{r["costs"][way]:.0f}' if way in r['costs'] else '' for way in WAYS[:2]]
        rows.append([f'{r["count"]:,}', f'{r["seconds"]:.2f}', *errors, *times, *costs])
    head = ['emitting triangles', 'seconds', 'error: tree', 'power', 'uniform', 'times the time: power', 'uniform',
            'ns a selection: tree', 'power']
    return '\n'.join([f'{a.buildings} buildings from the street, {a.resolution}, {a.max_depth} bounces, {a.seeds} seeds of '
                      f'{a.spp} samples; roots of relMSE against {a.reference_spp} samples.', '', *table(head, rows), '',
                      '![error at equal time](charts/light_selection.svg)'])


def write(text, results):
    path = os.path.join(HERE, 'RESULTS.md')
    before = open(path).read()
    first, last = before.index(MARKS[0]) + len(MARKS[0]), before.index(MARKS[1])
    open(path, 'w').write(before[:first] + '\n' + text + '\n' + before[last:])
    series = {way: [(r['count'], r['errors'][way]) for r in results if way in r['errors']] for way in WAYS}
    os.makedirs(os.path.join(HERE, 'charts'), exist_ok=True)
    open(os.path.join(HERE, 'charts', 'light_selection.svg'), 'w').write(
        chart.lines('Choosing lights: error at equal time', 'emitting triangles', 'root of relMSE',
                    {way: points for way, points in series.items() if points}, (True, True)))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--work', required=True)
    parser.add_argument('--spillway', default=os.path.join(HERE, '..', 'build', 'spillway'))
    parser.add_argument('--light-bench', default=os.path.join(HERE, '..', 'build', 'light_bench'))
    parser.add_argument('--counts', default='1,100,10000,1000000')
    parser.add_argument('--buildings', default=300)
    parser.add_argument('--resolution', default='256x144')
    parser.add_argument('--max-depth', default=2)
    parser.add_argument('--spp', default='1,4,16,64')
    parser.add_argument('--seeds', default=4)
    parser.add_argument('--reference-spp', default=1024)
    parser.add_argument('--write', action='store_true')
    a = parser.parse_args()
    os.makedirs(a.work, exist_ok=True)
    city = os.path.join(a.work, 'city')
    if not os.path.exists(os.path.join(city, 'manifest.json')):
        run(a.spillway, 'city', '-o', city, '--buildings', a.buildings, '--street-lights', 0, '--time', 'night', '--camera',
            'street', '--terrain', 'flat', '--texels-per-metre', 0, '--seed', 1, '-q')
    results = [measure(a, city, int(count)) for count in a.counts.split(',')]
    text = report(a, results)
    print(text)
    if a.write:
        write(text, results)


if __name__ == '__main__':
    main()
