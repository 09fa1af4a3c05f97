#!/usr/bin/env python3
"""A city painted with face textures, within small parts of what a frame looks at: bytes read, and what paint costs.

  bench/city_textures.py --work DIR [--write]

Renders one frame of a generated city with everything in memory; within a tenth of the bytes of the tiles that the
frame touches, so that what it needs is ten times its share, also with waves that never turn back and with hits that are
not sorted; within a twentieth of these and of all tiles; and within what the report of the unsorted one says would do.
The same city unpainted beside it. Times are of direct reads. Bytes are those of the file, recounted by
bench/access_log.py from the log of a second run of the same frame without direct reads, so that /proc/self/io counts
the same: log, report and system must agree. --write puts the table into bench/RESULTS.md, between its marks, with a chart.
"""
import argparse
import glob
import json
import os
import struct
import subprocess
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import access_log  # noqa: E402
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
        a.resolution, '--threads', a.threads, '--wave-paths', a.wave_paths, '--report', report, '-q', *more)
    return json.load(open(report))


def share_of_tiles_met_again(log):
    """Of the tiles that a wave and the one before it touched: how many were still in memory, by count."""
    before, common, read = set(), 0, 0
    for wave in access_log.read_tiles(log):
        both = before & wave['touched_tiles']
        common += len(both)
        read += len(both & wave['read_tiles'])
        before = wave['touched_tiles']
    return f'{1 - read / common:.2f}' if common else ''


def row(a, name, store, base, *more):
    """Seconds of one render, bytes of another that writes its log."""
    timed = render(a, store, '--direct-io', *more)
    log = os.path.join(a.work, 'frame.access')
    logged = render(a, store, '--access-log', log, *more)
    counts = access_log.recount(log)
    ratio, found = access_log.disagreements(counts, logged)
    if found or logged['image_hash'] != timed['image_hash']:
        sys.exit(f'{name}: ' + '; '.join(found or ['another image']))
    hits = share_of_tiles_met_again(log)
    return [name, f'{timed["seconds"]:.1f}', f'{timed["seconds"] / base:.2f}', f'{counts["tile_bytes_read"] / MIB:.1f}',
            f'{counts["tile_bytes_touched"] / MIB:.1f}', f'{counts["worst_tile_ratio"]:.3f}', f'{counts["tiles_read_again"]}', hits,
            f'{ratio:.4f}', timed['image_hash'][:8]], logged


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--work', required=True)
    parser.add_argument('--spillway', default=os.path.join(HERE, '..', 'build', 'spillway'))
    parser.add_argument('--buildings', default=8000)
    parser.add_argument('--texels', default=2, help='a metre: a pixel sees about two of the finest level')
    parser.add_argument('--camera', default='aerial')
    parser.add_argument('--resolution', default='1280x720')
    parser.add_argument('--spp', default=4)
    parser.add_argument('--threads', default=2)
    parser.add_argument('--wave-paths', default=1 << 20)
    parser.add_argument('--write', action='store_true')
    a = parser.parse_args()
    os.makedirs(a.work, exist_ok=True)
    plain, painted = city(a, 'plain', 0), city(a, 'painted', a.texels)
    constant = render(a, plain, '--direct-io')
    base = min(constant['seconds'], render(a, plain, '--direct-io')['seconds'])
    all_bytes = tiles(painted) * 64 * 64 * 3
    first, whole = row(a, 'everything in memory', painted, base)
    touched = whole['textures']['tiles_touched'] * 64 * 64 * 3
    share = lambda size: ('--texture-share', int(size))  # noqa: E731
    rows = [['constant colours', f'{base:.1f}', '1'] + [''] * 6 + [constant['image_hash'][:8]], first]
    add = lambda name, *more: rows.append(row(a, name, painted, base, *more)[0])  # noqa: E731
    add('within a tenth of what it touches', *share(touched / 10))
    add('the same, every wave in the order of the file', *share(touched / 10), '--no-turn-hits')
    unsorted, report = row(a, 'the same, hits not sorted', painted, base, *share(touched / 10), '--no-sort-hits')
    rows.append(unsorted)
    if 'advice' in report['textures']:
        option, size = report['textures']['advice'].split()
        add(f'not sorted, within the {size} that its report names', option, size, '--no-sort-hits')
    add('sorted, within a twentieth of what it touches', *share(touched / 20))
    add('within a twentieth of all tiles', *share(all_bytes / 20))
    if len({r[-1] for r in rows[1:]}) != 1:
        sys.exit('the painted pictures differ')
    head = ['', 'seconds', 'of the plain one', 'MiB read', 'MiB unique, by wave', 'read / unique, worst wave',
            'tiles read again in a wave', "of the last wave's tiles still there", "counted / the process's reads", 'image']
    lines = ['| ' + ' | '.join(r) + ' |' for r in [head, ['---'] * len(head), *rows]]
    text = '\n'.join([f'{a.buildings} buildings at {a.texels} texels a metre, {a.camera}, {a.resolution}, {a.spp} '
                      f'samples: {all_bytes / MIB:.0f} MiB of tiles, {touched / MIB:.0f} MiB of them touched.', '',
                      *lines])
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
