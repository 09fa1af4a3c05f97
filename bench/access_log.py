#!/usr/bin/env python3
"""Reads a log of `spillway render --access-log`, and recomputes from it what the report claims.

usage: bench/access_log.py LOG [--report REPORT.json] [--check]

Prints the waves, the pages that sweeps touched, the bytes read, and their ratio: promise 4 says that a page that is not
resident is read at most once a sweep. Of textures: the bytes of the tiles that waves touched and read, both as they lie in
files. With a report, its own counters and those of the system stand beside; they must agree. --check also fails when pages
are read more than 1.02 times a sweep, or tiles in any wave more than 1.05 times.
Format: pipeline/render/access_log.h, tile_log.h and cache/section_file.h.
"""
import argparse
import json
import struct
import sys

LISTS = ['camera', 'continued', 'shadow', 'camera_boxes', 'later_boxes', 'attributes', 'swept', 'read', 'read_attributes']
WAVE = struct.Struct('<4Q7d')


def sections(path):
    data = open(path, 'rb').read()
    if data[:8] != b'SPWACCES':
        sys.exit(f'{path}: is no access log')
    count = struct.unpack_from('<I', data, 12)[0]
    found = {}
    for i in range(count):
        name, offset, size, _ = struct.unpack_from('<32sQQQ', data, 32 + 56 * i)
        found[name.rstrip(b'\0').decode()] = data[offset:offset + size]
    return found


class Lists:
    """The sets of all waves, read one after the other."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def number(self):
        value = shift = 0
        while True:
            byte = self.data[self.at]
            self.at += 1
            value |= (byte & 0x7f) << shift
            if byte < 0x80:
                return value
            shift += 7

    def next(self):
        items, item = [], 0
        for _ in range(self.number()):
            item += self.number()
            items.append(item)
        return items


def read(path):
    """(bytes of each page, bytes of each attribute block, waves as dictionaries)"""
    found = sections(path)
    pages = struct.unpack(f'<{len(found["page_bytes"]) // 8}Q', found['page_bytes'])
    blocks = struct.unpack(f'<{len(found["attribute_bytes"]) // 8}Q', found['attribute_bytes'])
    lists, waves = Lists(found['sets']), []
    for row in WAVE.iter_unpack(found['waves']):
        wave = dict(zip(('paths', 'shadows', 'generated', 'spilled'), row))
        wave.update({name: lists.next() for name in LISTS})
        wave['is_lot'] = wave['paths'] + wave['shadows'] == 0  # a sweep of parked rays
        waves.append(wave)
    return pages, blocks, waves


def read_tiles(path):
    """Of each wave the tiles that it touched and read, their bytes, and how many reads were not the wave's first."""
    found = sections(path)
    tile_bytes = struct.unpack(f'<{len(found["tile_bytes"]) // 4}I', found['tile_bytes'])
    chunk = 0
    while f'tiles{chunk}' in found:
        lists = Lists(found[f'tiles{chunk}'])
        while lists.at < len(lists.data):
            touched, read_tiles = set(lists.next()), set()
            read = again = tile = 0
            for _ in range(lists.number()):
                tile += lists.number()
                times = lists.number()
                read += tile_bytes[tile] * times
                again += times - 1
                read_tiles.add(tile)
            yield {'touched': sum(tile_bytes[tile] for tile in touched), 'read': read, 'again': again,
                   'touched_tiles': touched, 'read_tiles': read_tiles}
        chunk += 1


def recount(path):
    pages, blocks, waves = read(path)
    touched = sum(pages[p] for wave in waves for p in wave['swept'])
    tiles = [{what: t[what] for what in ('touched', 'read', 'again')}
             for t, wave in zip(read_tiles(path), waves) if not wave['is_lot']]
    return {
        'waves': sum(1 for wave in waves if not wave['is_lot']),
        'sweeps_of_the_lot': sum(1 for wave in waves if wave['is_lot']),
        'sweeps': sum(1 for wave in waves if wave['swept']),
        'bytes_touched': touched,
        'bytes_read': sum(pages[p] for wave in waves for p in wave['read']),
        'attribute_bytes_read': sum(blocks[b] for wave in waves for b in wave['read_attributes']),
        'bytes_needed': sum(pages[p] for wave in waves
                            for p in set(wave['camera']) | set(wave['continued']) | set(wave['shadow'])),
        'tile_bytes_touched': sum(t['touched'] for t in tiles),
        'tile_bytes_read': sum(t['read'] for t in tiles),
        'tiles_read_again': sum(t['again'] for t in tiles),
        'worst_tile_ratio': max((t['read'] / t['touched'] for t in tiles if t['touched']), default=0),
        'tiles_by_wave': tiles,
    }


def totals(path):
    """recount() without what it has wave by wave."""
    counts = recount(path)
    del counts['tiles_by_wave']
    return counts


def disagreements(counts, report):
    """What the report says otherwise than the log, or the system otherwise than both by more than 2 %."""
    said = [('pages', counts['bytes_read'], report['pages']['bytes_read']),
            ('attributes', counts['attribute_bytes_read'], report['attributes']['bytes_read']),
            ('tiles', counts['tile_bytes_read'], report.get('textures', {}).get('bytes_read', 0))]
    found = [f'{what}: the log says {mine}, the report {other}' for what, mine, other in said if mine != other]
    for number, (tiles, wave) in enumerate(zip(counts['tiles_by_wave'], report['waves'])):
        other = wave.get('textures', {})
        if (tiles['touched'], tiles['read']) != (other.get('wave_unique_bytes', 0), other.get('bytes_read', 0)):
            found.append(f'tiles of wave {number}: the log says {tiles["touched"]} touched, {tiles["read"]} read, the report {other}')
    others = sum(use['read_bytes'] for what, use in report['io']['by_purpose'].items()
                 if what not in ('pages', 'attributes', 'textures'))
    ratio = (sum(mine for _, mine, _ in said) + others) / max(1, report['io']['process_read_bytes'])
    # Direct reads are of whole blocks of the disk: more than the tiles in them.
    if not report['io']['direct'] and abs(ratio - 1) > 0.02:
        found.append(f'the system counts {report["io"]["process_read_bytes"]} bytes, {1 / ratio:.3f} times as many')
    return ratio, found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('log')
    parser.add_argument('--report')
    parser.add_argument('--check', action='store_true')
    arguments = parser.parse_args()
    counts = recount(arguments.log)
    for name, value in counts.items():
        if name != 'tiles_by_wave':
            print(f'{name:<22} {value}')
    pages = counts['bytes_read'] / max(1, counts['bytes_touched'])
    print(f'{"pages, read / touched":<22} {pages:.4f}')
    print(f'{"tiles, read / touched":<22} {counts["tile_bytes_read"] / max(1, counts["tile_bytes_touched"]):.4f}')
    if arguments.report:
        ratio, found = disagreements(counts, json.load(open(arguments.report)))
        print(f'{"of what the system read":<22} {ratio:.4f}')
        if found:
            sys.exit('\n'.join(found))
    if arguments.check and (pages > 1.02 or counts['worst_tile_ratio'] > 1.05):
        sys.exit('more was read than promised')


if __name__ == '__main__':
    main()
