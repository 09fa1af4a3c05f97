#!/usr/bin/env python3
"""Reads a log of `spillway render --access-log`, and recomputes from it what the report claims.

usage: bench/access_log.py LOG [--report REPORT.json]

Prints the waves, the pages that sweeps touched, the bytes read, and their ratio: promise 4 says that a page that is not
resident is read at most once a sweep. With a report, its own counters stand beside.
Format: pipeline/render/access_log.h and cache/section_file.h.
"""
import argparse
import json
import struct
import sys

LISTS = ['camera', 'continued', 'shadow', 'sampled', 'attributes', 'swept', 'read', 'read_attributes']
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
        waves.append(wave)
    return pages, blocks, waves


def recount(path):
    pages, blocks, waves = read(path)
    touched = sum(pages[p] for wave in waves for p in wave['swept'])
    return {
        'waves': len(waves),
        'sweeps': sum(1 for wave in waves if wave['swept']),
        'bytes_touched': touched,
        'bytes_read': sum(pages[p] for wave in waves for p in wave['read']),
        'attribute_bytes_read': sum(blocks[b] for wave in waves for b in wave['read_attributes']),
        'bytes_needed': sum(pages[p] for wave in waves
                            for p in set(wave['camera']) | set(wave['continued']) | set(wave['shadow'])),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('log')
    parser.add_argument('--report')
    arguments = parser.parse_args()
    counts = recount(arguments.log)
    for name, value in counts.items():
        print(f'{name:<22} {value}')
    if counts['bytes_touched']:
        print(f'{"read / touched":<22} {counts["bytes_read"] / counts["bytes_touched"]:.4f}')
    if arguments.report:
        report = json.load(open(arguments.report))
        print(f'{"read by the report":<22} {report["pages"]["bytes_read"]}')
        if report['pages']['bytes_read'] != counts['bytes_read']:
            sys.exit('the report and the log do not agree')


if __name__ == '__main__':
    main()
