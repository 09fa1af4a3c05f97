#!/usr/bin/env python3
"""Frame benchmarks on generated cities: one command each, with a table and a chart.

  bench/city_bench.py memory     time against memory, street and aerial
  bench/city_bench.py size       time against size, 1, 4, 16 and 64 times, at one budget
  bench/city_bench.py ablations  what each idea is worth: switches that cannot change a bit
  bench/city_bench.py forest     a million instanced trees behind a city, against memory
  bench/city_bench.py whatif     predictions from one log against renders
  bench/city_bench.py waves      spilled waves of 1 to 64 Mi paths, a part of the pages in memory

Stores, reports and results are kept in --work, so that a benchmark can be made in pieces (--only) and goes on where it
stopped; --write puts the table into bench/RESULTS.md, between its marks, and the chart into bench/charts/.
"""
import argparse
import json
import math
import os
import random
import re
import subprocess
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import access_log  # noqa: E402
import chart  # noqa: E402

HERE = os.path.dirname(os.path.abspath(__file__))
MIB, GIB = 1 << 20, 1 << 30
TITLES = {'memory': 'Time against memory', 'size': 'Time against size', 'ablations': 'What each idea is worth',
          'forest': 'A forest behind houses', 'whatif': 'What another budget would do', 'waves': 'Wave size'}


class Bench:
    def __init__(self, arguments):
        self.arguments, self.work = arguments, arguments.work
        os.makedirs(self.work, exist_ok=True)
        self.path = os.path.join(self.work, arguments.bench + '.json')
        self.results = json.load(open(self.path)) if os.path.exists(self.path) else {}

    def run(self, *command):
        print('  ' + ' '.join(map(str, command)), file=sys.stderr)
        done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
        if done.returncode not in (0, 4):
            sys.exit(f'{" ".join(map(str, command))}\nended with {done.returncode}: {done.stderr}')
        return done

    def city(self, buildings, camera='aerial', *more):
        """The folder of a packed city; generated when it is not there."""
        name = '-'.join(['city', str(buildings), camera, *[str(m).strip('-') for m in more]])
        folder = os.path.join(self.work, name)
        store = os.path.join(folder, 'city.store')
        if not os.path.exists(os.path.join(store, 'manifest.spw')):
            self.run(self.arguments.spillway, 'city', '-o', folder, '--buildings', buildings, '--camera', camera,
                     '--format', 'store', '--memory', '2GiB', '--texels-per-metre', 0, '-q', *more)
        return store

    def forest(self, buildings, trees):
        """The store of a city with a forest behind it: its own trees, entered so many times more."""
        folder = os.path.join(self.work, f'forest-{buildings}-{trees}')
        store = os.path.join(folder, 'city.store')
        if not os.path.exists(os.path.join(store, 'manifest.spw')):
            self.run(self.arguments.spillway, 'city', '-o', folder, '--buildings', buildings, '--camera', 'aerial',
                     '--texels-per-metre', 0, '--terrain', 'flat', '-q')
            plant_forest(folder, trees)
            self.run(self.arguments.spillway, 'pack', os.path.join(folder, 'city.pbrt'), '-o', store, '--memory', '2GiB', '-q')
        return store

    def render(self, store, *more, spp=None, log=None):
        report = os.path.join(self.work, 'report.json')
        a = self.arguments
        command = [a.spillway, 'render', store, '-o', os.path.join(self.work, 'frame.exr'), '--spp', spp or a.spp, '--resolution',
                   a.resolution, '--max-depth', 5, '--threads', a.threads, '--direct-io', '--report', report, '-q', *more]
        if log:
            command += ['--access-log', log]
        self.run(*command)
        return json.load(open(report))

    def once(self, key, make):
        """The result of this name; made when it is asked for and not there."""
        wanted = not self.arguments.only or any(re.fullmatch(only, key) for only in self.arguments.only)
        if key not in self.results and wanted:
            print(key, file=sys.stderr)
            self.results[key] = make()
            json.dump(self.results, open(self.path, 'w'), indent=1)
        return self.results.get(key)

    def in_turns(self, names, key, make):
        """The fastest run of each name, one of each in every turn; {} where none is to be made."""
        runs = {}
        for turn in [''] + [f'-turn{turn}' for turn in range(2, self.arguments.repeat + 1)]:
            for name in names:
                run = self.once(f'{key}{name}{turn}', lambda: make(name))
                if run:
                    runs.setdefault(name, []).append(run)
        if any(run['hash'] != of_name[0]['hash'] for of_name in runs.values() for run in of_name):
            sys.exit(f'{key}: images of one frame differ')
        return {name: min(of_name, key=lambda run: run['seconds']) for name, of_name in runs.items()}

    def publish(self, mark, table, svg):
        print(table)
        if not self.arguments.write:
            return
        os.makedirs(os.path.join(HERE, 'charts'), exist_ok=True)
        with open(os.path.join(HERE, 'charts', f'{mark}.svg'), 'w') as file:
            file.write(svg)
        path = os.path.join(HERE, 'RESULTS.md')
        text = open(path).read()
        block = f'<!-- {mark} -->\n{table}\n![{mark}](charts/{mark}.svg)\n<!-- end of {mark} -->'
        marks = re.compile(rf'<!-- {mark} -->.*<!-- end of {mark} -->', re.S)
        if not marks.search(text):
            text += f'\n## {TITLES[mark]}\n\n`bench/city_bench.py {mark}`\n\n{block}\n'
        open(path, 'w').write(marks.sub(lambda _: block, text))


def plant_forest(folder, trees):
    """Writes instances of the city's trees in a half ring behind it, as its camera looks, one on eighteen square metres."""
    kinds = sorted(set(re.findall(r'ObjectBegin "(tree\d+)"', open(os.path.join(folder, 'objects.pbrt')).read())))
    scene = open(os.path.join(folder, 'city.pbrt')).read()
    at = [float(word) for word in re.search(r'LookAt ([^\n]*)', scene).group(1).split()]
    ahead = math.atan2(at[4] - at[1], at[3] - at[0])
    inner = json.load(open(os.path.join(folder, 'manifest.json')))['radius_m'] * 1.1
    outer = math.sqrt(inner * inner + trees * 2 * 9 / math.pi * 2)
    numbers = random.Random(1)
    with open(os.path.join(folder, 'forest.pbrt'), 'w') as file:
        for _ in range(trees):
            radius = math.sqrt(numbers.uniform(inner * inner, outer * outer))
            angle, turn, scale = ahead + numbers.uniform(-1, 1) * math.pi / 2, numbers.uniform(0, math.tau), numbers.uniform(0.7, 1.3)
            c, s = scale * math.cos(turn), scale * math.sin(turn)
            file.write(f'AttributeBegin\nTransform [ {c:.6f} {s:.6f} 0 0 {-s:.6f} {c:.6f} 0 0 0 0 {scale:.6f} 0 '
                       f'{radius * math.cos(angle):.3f} {radius * math.sin(angle):.3f} 0 1 ]\n'
                       f'ObjectInstance "{numbers.choice(kinds)}"\nAttributeEnd\n')
    with open(os.path.join(folder, 'city.pbrt'), 'a') as file:
        file.write('Include "forest.pbrt"\n')


def facts(report):
    """What the tables need of a report."""
    stages = {name: stage['seconds'] for name, stage in report['stages'].items()}
    return {
        'seconds': report['seconds'], 'hash': report['image_hash'], 'stages': stages, 'waves': len(report['waves']),
        'wave_paths': report['plan']['wave_paths'], 'spills': report['plan']['spills'],
        'rays': report['stages']['trace_rays']['rays'], 'page_bytes_read': report['pages']['bytes_read'],
        'pages_evicted': report['pages']['evicted'], 'attribute_bytes_read': report['attributes']['bytes_read'],
        'wait_seconds': report['pages']['wait_seconds'] + report['attributes']['wait_seconds'],
        'largest_wave_rays': max(wave['paths'] + wave['shadow_rays'] for wave in report['waves']),
        'scratch_bytes': report['scratch_peak_bytes'],
        'spilled_bytes': report['spilled_bytes'], 'resident_bytes': report['memory']['resident_peak_bytes'],
        'floor_bytes': report['memory']['floor_bytes'], 'film_bytes': report['memory']['peak_by_tag'].get('film', 0),
        'untagged_bytes': report['memory']['untagged_bytes'],
    }


def geometry_bytes(bench, store):
    info = json.loads(bench.run(bench.arguments.spillway, 'info', store, '--json').stdout)
    return {'triangles': info['triangles'], 'instanced': info['triangles_instanced'], 'pages': info['pages'],
            'bytes': info['page_bytes'] + info['attribute_bytes']}


def gib(count):
    return f'{count / GIB:.2f}' if count >= 10 * MIB else f'{count / GIB:.3f}'


# ---- time against memory ----

SHARES = [100, 50, 25, 10]


def against_memory(bench, name, store):
    """Rows of one store: unlimited, then with each share of its geometry; of several turns the fastest run of each."""
    geometry = bench.once(f'{name}-geometry', lambda: geometry_bytes(bench, store()))
    first = bench.once(f'{name}-unlimited', lambda: facts(bench.render(store())))
    if not first or not geometry:
        return geometry, first, {}
    budgets = {share: first['floor_bytes'] + first['film_bytes'] + 512 * MIB + geometry['bytes'] * share // 100
               for share in SHARES}
    limit = lambda share: [] if share == 'unlimited' else ['--memory', budgets[share]]
    rows = bench.in_turns(['unlimited', *SHARES], f'{name}-', lambda share: facts(bench.render(store(), *limit(share))))
    whole = rows.pop('unlimited')
    for share, row in rows.items():
        if row['hash'] != whole['hash']:
            sys.exit(f'{name} at {share} %: another image')
        row['budget'] = budgets[share]
        log = os.path.join(bench.work, f'{name}-{share}.access')
        row['recount'] = bench.once(f'{name}-{share}-recount', lambda: (
            bench.render(store(), '--memory', budgets[share], '--log-parked', log=log), access_log.totals(log))[1])
    return geometry, whole, rows


def memory(bench):
    cameras = {camera: against_memory(bench, camera, lambda camera=camera: bench.city(bench.arguments.buildings, camera))
               for camera in ('street', 'aerial')}
    lines = ['| camera, memory | budget GiB | seconds | of unlimited | waves | pages evicted | page GiB read | '
             'of pages touched | waited s | resident GiB |', '|---|---|---|---|---|---|---|---|---|---|']
    series = {}
    for camera, (geometry, whole, rows) in cameras.items():
        if not whole:
            continue
        lines.append(f'| {camera}, unlimited ({geometry["triangles"] / 1e6:.1f} M triangles, {gib(geometry["bytes"])} GiB) | | '
                     f'{whole["seconds"]:.1f} | 1 | {whole["waves"]} | 0 | {gib(whole["page_bytes_read"])} | | | '
                     f'{gib(whole["resident_bytes"])} |')
        for share, row in rows.items():
            ratio = row['seconds'] / whole['seconds']
            series.setdefault(camera, []).append((share, ratio))
            counted = row['recount']
            touched = f'{counted["bytes_read"] / counted["bytes_touched"]:.3f}' if counted and counted['bytes_touched'] else ''
            lines.append(f'| {camera}, {share} % | {gib(row["budget"])} | {row["seconds"]:.1f} | **{ratio:.2f}** | {row["waves"]} | '
                         f'{row["pages_evicted"]} | {gib(row["page_bytes_read"])} | {touched} | {row["wait_seconds"]:.1f} | '
                         f'{gib(row["resident_bytes"])} |')
    svg = chart.lines('Time against memory', 'memory for geometry, % of its size (beside floor, film and 512 MiB)',
                      'time, of unlimited', series, (True, False), 0) if series else ''
    bench.publish('memory', '\n'.join(lines), svg)


def forest(bench):
    a = bench.arguments
    geometry, whole, rows = against_memory(bench, 'forest', lambda: bench.forest(a.buildings, a.trees))
    if not whole or not geometry:
        return
    lines = ['| memory | budget GiB | seconds | of unlimited | waves | pages evicted | page GiB read | resident GiB |',
             '|---|---|---|---|---|---|---|---|']
    lines.append(f'| unlimited ({geometry["triangles"] / 1e6:.1f} M triangles, seen as {geometry["instanced"] / 1e9:.1f} G) | | '
                 f'{whole["seconds"]:.1f} | 1 | {whole["waves"]} | 0 | {gib(whole["page_bytes_read"])} | {gib(whole["resident_bytes"])} |')
    for share, row in rows.items():
        lines.append(f'| {share} % | {gib(row["budget"])} | {row["seconds"]:.1f} | {row["seconds"] / whole["seconds"]:.2f} | '
                     f'{row["waves"]} | {row["pages_evicted"]} | {gib(row["page_bytes_read"])} | {gib(row["resident_bytes"])} |')
    points = [(share, row['seconds'] / whole['seconds']) for share, row in rows.items()]
    bench.publish('forest', '\n'.join(lines), chart.lines('A forest behind houses', 'memory for geometry, %', 'time, of unlimited',
                                                          {'forest': points}, (True, False), 0))


# ---- time against size ----

def size(bench):
    base = bench.arguments.buildings
    lines = ['| size | M triangles | geometry GiB | seconds | M rays | ns a ray | pages evicted | page GiB read | resident GiB |',
             '|---|---|---|---|---|---|---|---|---|']
    points = []
    sizes = (1, 4, 16, 64)
    store = lambda times: bench.city(base * times, bench.arguments.camera)
    geometries = {times: bench.once(f'{times}-geometry', lambda: geometry_bytes(bench, store(times))) for times in sizes}
    rows = bench.in_turns(sizes, '', lambda times: facts(bench.render(store(times), '--memory', bench.arguments.memory)))
    for times, row in rows.items():
        geometry = geometries[times]
        if not geometry:
            continue
        ray = row['seconds'] / row['rays']
        points.append((geometry['triangles'], ray, row['pages_evicted']))
        lines.append(f'| {times} x | {geometry["triangles"] / 1e6:.1f} | {gib(geometry["bytes"])} | {row["seconds"]:.1f} | '
                     f'{row["rays"] / 1e6:.1f} | {ray * 1e9:.0f} | {row["pages_evicted"]} | {gib(row["page_bytes_read"])} | {gib(row["resident_bytes"])} |')
    beyond = [p for p in points if p[2] > 0]  # where pages had to leave memory
    if len(beyond) >= 2:
        (n0, t0, _), (n1, t1, _) = beyond[0], beyond[-1]
        lines.append(f'\nExponent of the time a ray, from {n0 / 1e6:.1f} to {n1 / 1e6:.1f} M triangles, where pages are evicted: '
                     f'**{math.log(t1 / t0) / math.log(n1 / n0):.2f}**.')
    svg = chart.lines('Time against size', 'million triangles', 'ns a ray', {
        f'--memory {bench.arguments.memory}': [(n / 1e6, t * 1e9) for n, t, _ in points]}, (True, True)) if points else ''
    bench.publish('size', '\n'.join(lines), svg)


# ---- ablations ----

SWITCHES = [
    ('as planned', []), ('rays not|sorted', ['--no-sort-rays']), ('hits not|sorted', ['--no-sort-hits']), ('hits sorted|by 16 Ki', ['--hit-batch', 16384]),
    ('no reading|ahead', ['--no-read-ahead']), ('resident pages|not first', ['--no-resident-first']),
    ('waiting rays|not parked', ['--no-park-rays']), ('pages known|by boxes alone', ['--no-page-tops']), ('waves not|topped up', ['--no-top-up']), ('spill|forced', ['--spill', 'always']), ('spill|forbidden', ['--spill', 'never']),
    ('waves of|64 Ki', ['--wave-paths', 1 << 16]), ('waves of|1 Mi', ['--wave-paths', 1 << 20]),
]


def ablations(bench):
    store = lambda: bench.city(bench.arguments.buildings, bench.arguments.camera)
    geometry = bench.once('geometry', lambda: geometry_bytes(bench, store()))
    whole = bench.once('unlimited', lambda: facts(bench.render(store())))
    lines = ['| | seconds | of as planned | sort | trace | shade | page GiB read | attribute GiB read | waited s | waves |',
             '|---|---|---|---|---|---|---|---|---|---|']
    bars, planned = [], None
    if whole and geometry:
        budget = whole['floor_bytes'] + whole['film_bytes'] + 512 * MIB + geometry['bytes'] * bench.arguments.share // 100
        for name, switches in SWITCHES:
            key = name.replace('|', ' ')
            row = bench.once(key, lambda: facts(bench.render(store(), '--memory', budget, *switches)))
            if not row:
                continue
            if row['hash'] != whole['hash']:
                sys.exit(f'{key}: another image')
            planned = planned or row['seconds']
            bars.append((name, row['seconds'] / planned))
            stages = row['stages']
            lines.append(f'| {key} | {row["seconds"]:.1f} | {row["seconds"] / planned:.2f} | {stages["sort_rays"]:.1f} | '
                         f'{stages["trace_rays"]:.1f} | {stages["shade_hits"]:.1f} | {gib(row["page_bytes_read"])} | '
                         f'{gib(row["attribute_bytes_read"])} | {row["wait_seconds"]:.1f} | {row["waves"]} |')
    svg = chart.bars(f'Ablations, {bench.arguments.share} % of the geometry in memory', 'time, of as planned', bars) if bars else ''
    bench.publish('ablations', '\n'.join(lines), svg)


# ---- what another budget would do ----

def whatif(bench):
    lines = ['| camera, memory for geometry | budget GiB | seconds, predicted | rendered | ratio | page GiB, predicted | rendered | ratio |',
             '|---|---|---|---|---|---|---|---|']
    series = {}
    for camera in ('street', 'aerial'):
        store = lambda: bench.city(bench.arguments.buildings, camera)
        geometry = bench.once(f'{camera}-geometry', lambda: geometry_bytes(bench, store()))
        log = os.path.join(bench.work, f'whatif-{camera}.access')
        whole = bench.once(f'{camera}-unlimited', lambda: facts(bench.render(store(), log=log)))
        if not whole or not geometry:
            continue
        fixed = whole['floor_bytes'] + whole['film_bytes'] + 512 * MIB
        for share in SHARES:
            budget = fixed + geometry['bytes'] * share // 100
            row = bench.once(f'{camera}-{share}', lambda: facts(bench.render(store(), '--memory', budget)))
            if not row:
                continue
            said = json.loads(bench.run(bench.arguments.spillway, 'whatif', log, '--memory', budget, '--json').stdout)[0]
            series.setdefault(f'{camera}, predicted', []).append((share, said['seconds']))
            series.setdefault(f'{camera}, rendered', []).append((share, row['seconds']))
            lines.append(f'| {camera}, {share} % | {gib(budget)} | {said["seconds"]:.1f} | {row["seconds"]:.1f} | '
                         f'**{said["seconds"] / row["seconds"]:.2f}** | {gib(said["page_bytes"])} | {gib(row["page_bytes_read"])} | '
                         f'**{said["page_bytes"] / max(1, row["page_bytes_read"]):.2f}** |')
    svg = chart.lines('What another budget would do', 'memory for geometry, %', 'seconds', series, (True, False)) if series else ''
    bench.publish('whatif', '\n'.join(lines), svg)


# ---- wave size ----

def waves(bench):
    store = lambda: bench.city(bench.arguments.buildings, bench.arguments.camera)
    geometry = bench.once('geometry', lambda: geometry_bytes(bench, store()))
    fixed = ['--spill', 'always', '--page-share', '1GiB', '--attribute-share', '256MiB', '--hit-sort-share', '256MiB',
             '--memory', '14GiB']
    lines = ['| paths a wave | largest wave, M rays | waves | seconds | tracing | page GiB read | attribute GiB read | spilled GiB | '
             'scratch GiB, peak | resident GiB |', '|---|---|---|---|---|---|---|---|---|---|']
    series = {'seconds': [], 'GiB of pages': [], 'GiB spilled': []}
    hashes = set()
    for mi in (1, 4, 16, 32, 64):
        row = bench.once(f'{mi}', lambda: facts(bench.render(store(), *fixed, '--wave-paths', mi << 20)))
        if not row or not geometry:
            continue
        hashes.add(row['hash'])
        for name, value in zip(series, (row['seconds'], row['page_bytes_read'] / GIB, row['spilled_bytes'] / GIB)):
            series[name].append((mi, value))
        lines.append(f'| {mi} Mi | {row["largest_wave_rays"] / 1e6:.1f} | {row["waves"]} | {row["seconds"]:.0f} | '
                     f'{row["stages"]["trace_rays"]:.0f} | {gib(row["page_bytes_read"])} | {gib(row["attribute_bytes_read"])} | '
                     f'{gib(row["spilled_bytes"])} | {gib(row["scratch_bytes"])} | {gib(row["resident_bytes"])} |')
    if len(hashes) > 1:
        sys.exit(f'other images: {hashes}')
    svg = chart.lines('Wave size', 'Mi paths a wave', 'seconds, GiB', series, (True, False), 0) if hashes else ''
    bench.publish('waves', '\n'.join(lines), svg)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('bench', choices=['memory', 'size', 'ablations', 'forest', 'whatif', 'waves'])
    parser.add_argument('--spillway', default=os.path.join(HERE, '..', 'build', 'spillway'))
    parser.add_argument('--work', required=True, help='directory for stores and results')
    parser.add_argument('--buildings', type=int, default=10500, help='of the city; of the smallest for size [%(default)s]')
    parser.add_argument('--camera', default='street')
    parser.add_argument('--trees', type=int, default=1000000, help='of the forest [%(default)s]')
    parser.add_argument('--share', type=int, default=25, help='%% of the geometry in memory, for ablations [%(default)s]')
    parser.add_argument('--memory', default='1GiB', help='budget for size [%(default)s]')
    parser.add_argument('--resolution', default='1280x720')
    parser.add_argument('--spp', type=int, default=16)
    parser.add_argument('--threads', type=int, default=2)
    parser.add_argument('--repeat', type=int, default=1, help='turns of memory, forest and size, whose fastest run counts [%(default)s]')
    parser.add_argument('--only', action='append', help='regular expressions of the results to make now')
    parser.add_argument('--write', action='store_true', help='into bench/RESULTS.md and bench/charts')
    arguments = parser.parse_args()
    arguments.spillway = os.path.abspath(arguments.spillway)
    globals()[arguments.bench](Bench(arguments))


if __name__ == '__main__':
    main()
