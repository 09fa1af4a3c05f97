#!/usr/bin/env python3
"""A city painted with face textures, within a tenth and a twentieth of them: bytes read, and what paint costs.

  bench/city_textures.py --work DIR [--write]

Renders one frame of a generated city with everything in memory, within a tenth of the tiles it touches (hits sorted, and
not), and within a twentieth; the same city unpainted beside it. Bytes are those of the file, with direct reads, so that
/proc/self/io counts the same. --write puts the table into bench/RESULTS.md, between its marks, with a chart.
"""
import argparse
import glob
import json
import os
import struct
import subprocess
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import chart  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
MIB = 1 << 20
MARKS = ('<!-- city_textures -->', '<!-- /city_textures -->')


def run(*command):
    print('  ' + ' '.join(map(str, command)), file=sys.stderr)
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode not in (0, 4):
        sys.exit(f'{" ".join(map(str, command))}\nended with {done.returncode}: {done.stderr}')


def city(a, name, texels):
    folder = os.path.join(a.work, name)
    store = os.path.join(folder, 'city.store')
    if not os.path.exists(os.path.join(store, 'manifest.spw')):
        run(a.spillway, 'city', '-o', folder, '--buildings', a.buildings, '--camera', a.camera, '--format', 'store',
            '--texels-per-metre', texels, '-q')
    return store


def tiles(store):
    """How many tiles the store's containers hold: from their trailers (docs/facetex.md)."""
    count = 0
    for path in glob.glob(os.path.join(store, 'textures', '*.facetex')):
        with open(path, 'rb') as file:
            file.seek(-112, os.SEEK_END)
            count += struct.unpack_from('<Q', file.read(112), 32)[0]
    return count


def render(a, store, *more):
    report = os.path.join(a.work, 'report.json')
    run(a.spillway, 'render', store, '-o', os.path.join(a.work, 'frame.exr'), '--spp', a.spp, '--resolution',
        a.resolution, '--threads', a.threads, '--direct-io', '--report', report, '-q', *more)
    return json.load(open(report))


def row(name, r, base):
    t, waves = r['textures'], [w['textures'] for w in r['waves']]
    read = sum(w['bytes_read'] for w in waves)
    unique = sum(w['wave_unique_bytes'] for w in waves)
    worst = max((w['bytes_read'] / w['wave_unique_bytes'] for w in waves if w['wave_unique_bytes']), default=0)
    mine = sum(p['read_bytes'] for p in r['io']['by_purpose'].values())
    return [name, f'{r["seconds"]:.1f}', f'{r["seconds"] / base:.2f}', f'{read / MIB:.1f}', f'{unique / MIB:.1f}',
            f'{worst:.3f}', f'{sum(w["tiles_read_again"] for w in waves)}',
            f'{mine / r["io"]["process_read_bytes"]:.4f}', r['image_hash'][:8]]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--work', required=True)
    parser.add_argument('--spillway', default=os.path.join(HERE, '..', 'build', 'spillway'))
    parser.add_argument('--buildings', default=1000)
    parser.add_argument('--texels', default=16)
    parser.add_argument('--camera', default='street')
    parser.add_argument('--resolution', default='1280x720')
    parser.add_argument('--spp', default=4)
    parser.add_argument('--threads', default=2)
    parser.add_argument('--wave-paths', default=1 << 20)
    parser.add_argument('--write', action='store_true')
    a = parser.parse_args()
    os.makedirs(a.work, exist_ok=True)
    plain, painted = city(a, 'plain', 0), city(a, 'painted', a.texels)
    large = ('--wave-paths', a.wave_paths)
    constant = render(a, plain, *large)
    base = min(constant['seconds'], render(a, plain, *large)['seconds'])
    whole = render(a, painted, *large)
    overhead = whole['plan']['texture_bytes'] - tiles(painted) * 64 * 64 * 3
    touched = whole['textures']['tiles_touched'] * 64 * 64 * 3
    share = lambda part: ('--texture-share', f'{overhead + touched // part}')  # noqa: E731
    rows = [['constant colours', f'{base:.1f}', '1', '', '', '', '', '', constant['image_hash'][:8]],
            row('everything in memory', whole, base)]
    tenth = render(a, painted, *large, *share(10))
    rows.append(row('within a tenth of the tiles it touches', tenth, base))
    unsorted = render(a, painted, *large, *share(10), '--hit-batch', 256)
    rows.append(row('the same, hits in batches of 256', unsorted, base))
    twentieth = ('--texture-share', f'{overhead + tiles(painted) * 12288 // 20}')
    rows.append(row('within a twentieth of all tiles', render(a, painted, *large, *twentieth), base))
    rows.append(row('within a twentieth of the tiles it touches', render(a, painted, *large, *share(20)), base))
    if len({r[-1] for r in rows[1:]}) != 1:
        sys.exit('the painted pictures differ')
    head = ['', 'seconds', 'of the plain one', 'MiB read', 'MiB unique, by wave', 'read / unique, worst wave',
            'tiles read again in a wave', "counted / the process's reads", 'image']
    lines = ['| ' + ' | '.join(r) + ' |' for r in [head, ['---'] * len(head), *rows]]
    text = '\n'.join([f'{a.buildings} buildings at {a.texels} texels a metre, {a.camera}, {a.resolution}, {a.spp} samples: '
                      f'{tiles(painted) * 12288 / MIB:.0f} MiB of tiles, {touched / MIB:.0f} MiB of them touched, '
                      f'{overhead / MIB:.0f} MiB of tables.', '', *lines])
    print(text)
    if not a.write:
        return
    path = os.path.join(HERE, 'RESULTS.md')
    results = open(path).read()
    first, last = results.index(MARKS[0]) + len(MARKS[0]), results.index(MARKS[1])
    open(path, 'w').write(results[:first] + '\n' + text + '\n' + results[last:])
    os.makedirs(os.path.join(HERE, 'charts'), exist_ok=True)
    open(os.path.join(HERE, 'charts', 'city_textures.svg'), 'w').write(
        chart.bars('Face textures read in one frame', 'MiB', [(r[0], float(r[3])) for r in rows[1:]]))


if __name__ == '__main__':
    main()
