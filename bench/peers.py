#!/usr/bin/env python3
"""Other renderers on the same work in the same run: what `spillway lab --peers` shows.

usage: bench/peers.py -o peers.csv [--spp 16,64,256] [--seeds 3] [--scenes box,lamps] [--city FOLDER]
                      [--variants llvm_ad_rgb,llvm_ad_rgb-unmerged,scalar_rgb] [--spillway build/spillway]

The scenes are those of tests/twins, written for both renderers, held against tests/images. With --city also a folder of
`spillway city --tessellate --trees 0 --cars 0`, converted by tools/city_to_mitsuba.py (what instances are left become
meshes) and held against Mitsuba's own picture of --reference-spp samples with another seed: materials differ a little
between the two, so that an error against either one's picture favours it. Both filter by a box: through a Gaussian a
sample of Mitsuba's counts for the pixels around it too, which blurs noise, and one of Spillway's does not.

Renderers take turns, each in a process of its own, whose highest resident set is taken. Seconds are those of the second
of two renders of one process for Mitsuba, whose first one compiles, and of the frame for Spillway, its reading of the
geometry included; of a city a second row has what a frame of twice the samples takes longer. A variant that ends in
-unmerged is for cities: their meshes stay as they are, where Mitsuba else merges those of one material.

A variant that does not run is left out with a line. Without the package mitsuba (pip install mitsuba numpy OpenEXR) it
says so and writes the header alone.
"""

import argparse
import importlib.util
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
UNMERGED = '-unmerged'
HEADER = 'scene,renderer,spp,seed,seconds,peak_bytes,rel_mse,flip'


def twin_scenes(mi):
    """SCENES of make_twins.py, made for the variant that is set: its own choice of one is left out."""
    path = ROOT / 'tests' / 'twins' / 'make_twins.py'
    source = path.read_text().replace('mi.set_variant("scalar_rgb")', 'pass')
    names = {'__file__': str(path), '__name__': 'twins'}
    exec(compile(source, str(path), 'exec'), names)
    return names['SCENES']


def child_mitsuba(job):
    """In a process of its own: renders twice, writes the second, prints seconds and the highest resident set."""
    import mitsuba as mi
    import numpy as np
    import OpenEXR
    mi.set_variant(job['variant'].removesuffix(UNMERGED))
    if 'city' in job:
        scene = mi.load_file(job['city'], optimize=not job['variant'].endswith(UNMERGED))
    else:
        integrator = {'type': 'path', 'max_depth': 65}
        scene = mi.load_dict({'type': 'scene', 'integrator': integrator, **twin_scenes(mi)[job['scene']]})
    for seed in (job['seed'] + 1000, job['seed']):
        begin = time.perf_counter()
        image = np.array(mi.render(scene, spp=job['spp'], seed=seed), dtype=np.float32)
        seconds = time.perf_counter() - begin
    channels = {name: np.ascontiguousarray(image[:, :, i]) for i, name in enumerate('RGB')}
    OpenEXR.File({'compression': OpenEXR.ZIP_COMPRESSION, 'type': OpenEXR.scanlineimage}, channels).write(job['output'])
    print(json.dumps({'seconds': seconds, 'peak_bytes': resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024}))


def mitsuba(job):
    command = [sys.executable, __file__, '--child', json.dumps(job)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def runs(variant, work):
    """Whether a variant renders anything here: the ones on LLVM want a library of the system's that they understand."""
    try:
        mitsuba({'spp': 1, 'seed': 1, 'scene': 'box', 'variant': variant, 'output': os.path.join(work, 'probe.exr')})
        return True
    except subprocess.CalledProcessError:
        print(f'peers: skipped: Mitsuba 3 does not run as {variant} here', file=sys.stderr)
        return False


def spillway(program, scene, store, job, options=()):
    report = job['output'] + '.json'
    subprocess.run([program, 'render', str(scene), '--store', store, '-o', job['output'], '--spp', str(job['spp']),
                    '--seed', str(job['seed']), '--report', report, '-q', *options], check=True)
    facts = json.loads(pathlib.Path(report).read_text())
    return {'seconds': facts['seconds'], 'peak_bytes': facts['memory']['resident_peak_bytes']}


def errors(program, picture, reference):
    """compare exits with 1 where pictures differ, which these do."""
    command = [program, 'compare', picture, reference, '--json']
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    facts = json.loads(done.stdout)
    return facts['rel_mse'], facts['flip']


def quoted(text):
    return '"' + text.replace('"', '""') + '"' if ',' in text or '"' in text else text


class Table:
    def __init__(self, arguments, work):
        self.arguments, self.work, self.lines = arguments, work, [HEADER]

    def add(self, scene, renderer, job, reference, measured):
        rel_mse, flip = errors(self.arguments.spillway, job['output'], str(reference))
        self.lines.append(f'{quoted(scene)},{quoted(renderer)},{job["spp"]},{job["seed"]},{measured["seconds"]:.6g},'
                          f'{measured["peak_bytes"]},{rel_mse:.6g},{flip:.6g}')
        print(self.lines[-1])

    def jobs(self):
        for spp in self.arguments.spp:
            for seed in range(1, self.arguments.seeds + 1):
                yield {'spp': spp, 'seed': seed, 'output': os.path.join(self.work, 'picture.exr')}

    def twin(self, name):
        reference, scene = ROOT / 'tests' / 'images' / f'{name}.exr', ROOT / 'tests' / 'twins' / f'{name}.pbrt'
        for job in self.jobs():
            self.add(name, 'Spillway', job, reference,
                     spillway(self.arguments.spillway, scene, os.path.join(self.work, name + '.store'), job))
            for variant in self.arguments.variants:
                if variant.endswith(UNMERGED):
                    continue
                measured = mitsuba({**job, 'scene': name, 'variant': variant})
                self.add(name, 'Mitsuba 3 ' + variant, job, reference, measured)

    def city(self, folder):
        xml, reference = os.path.join(self.work, 'city.xml'), os.path.join(self.work, 'reference.exr')
        resolution = ['--resolution', self.arguments.resolution]
        scene = pathlib.Path(folder, 'peers.pbrt')
        scene.write_text('PixelFilter "box"\nInclude "city.pbrt"\n')
        converter = str(ROOT / 'tools' / 'city_to_mitsuba.py')
        subprocess.run([sys.executable, converter, folder, '-o', xml, '--expand-instances', '--filter', 'box', *resolution], check=True)
        mitsuba({'city': xml, 'variant': self.arguments.variants[0], 'spp': self.arguments.reference_spp, 'seed': 77,
                 'output': reference})
        for job in self.jobs():
            measured = spillway(self.arguments.spillway, scene, os.path.join(self.work, 'city.store'), job, resolution)
            self.add('city', 'Spillway', job, reference, measured)
            twice = spillway(self.arguments.spillway, scene, os.path.join(self.work, 'city.store'),
                             {**job, 'spp': 2 * job['spp'], 'output': os.path.join(self.work, 'twice.exr')}, resolution)
            twice['seconds'] -= measured['seconds']
            self.add('city', 'Spillway, geometry in memory', job, reference, twice)
            for variant in self.arguments.variants:
                measured = mitsuba({**job, 'city': xml, 'variant': variant})
                self.add('city', 'Mitsuba 3 ' + variant, job, reference, measured)


def main():
    if len(sys.argv) == 3 and sys.argv[1] == '--child':
        return child_mitsuba(json.loads(sys.argv[2]))
    numbers = lambda text: [int(v) for v in text.split(',')]
    names = lambda text: [name for name in text.split(',') if name]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('-o', '--output', required=True)
    parser.add_argument('--spp', type=numbers, default=[16, 64, 256])
    parser.add_argument('--seeds', type=int, default=3)
    parser.add_argument('--scenes', type=names, default=['box', 'lamps', 'plastic', 'texture'], help='of tests/twins; an empty one for none')
    parser.add_argument('--city', help='a folder of `spillway city --tessellate`')
    parser.add_argument('--resolution', default='640x360', help='of the city')
    parser.add_argument('--reference-spp', type=int, default=1024, help='of the city')
    parser.add_argument('--variants', type=names, default=['llvm_ad_rgb', 'scalar_rgb'],
                        help='of Mitsuba, whose llvm ones want LLVM 16 or newer (DRJIT_LIBLLVM_PATH)')
    parser.add_argument('--spillway', default=str(ROOT / 'build' / 'spillway'))
    arguments = parser.parse_args()
    missing = [name for name in ('mitsuba', 'numpy', 'OpenEXR') if importlib.util.find_spec(name) is None]
    lines = [HEADER]
    if missing:
        print(f'peers: skipped: there is no {", ".join(missing)} (pip install mitsuba numpy OpenEXR)', file=sys.stderr)
    else:
        with tempfile.TemporaryDirectory() as work:
            arguments.variants = [variant for variant in arguments.variants if runs(variant, work)]
            table = Table(arguments, work)
            for name in arguments.scenes:
                table.twin(name)
            if arguments.city:
                table.city(arguments.city)
            lines = table.lines
    unfinished = arguments.output + '.unfinished'
    pathlib.Path(unfinished).write_text('\n'.join(lines) + '\n')
    os.replace(unfinished, arguments.output)


if __name__ == '__main__':
    main()
