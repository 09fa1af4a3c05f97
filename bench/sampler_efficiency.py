#!/usr/bin/env python3
"""Sobol' samples against independent ones on the scenes of tests/twins: error, time, efficiency.

  bench/sampler_efficiency.py build/spillway [--spp 64] [--seeds 8]

Error is the mean relative squared error against tests/images, over several seeds; efficiency its inverse over the time
of rendering. Markdown rows on standard output; the exit code is 1 when Sobol' samples are the less efficient anywhere.
"""

import argparse
import json
import math
import pathlib
import subprocess
import sys
import tempfile

TESTS = pathlib.Path(__file__).resolve().parent.parent / "tests"


def render(program, scene, folder, seed, arguments):
    """Relative squared error and seconds."""
    picture, report = folder / "a.exr", folder / "a.json"
    subprocess.run([program, "render", scene, "--store", folder / "a.store", "-o", picture, "--report", report, "-q",
                    "--seed", str(seed), *arguments], check=True)
    compared = subprocess.run([program, "compare", picture, TESTS / "images" / (scene.stem + ".exr"), "--json"],
                              check=False, capture_output=True, text=True)
    return json.loads(compared.stdout)["rel_mse"], json.loads(report.read_text())["seconds"]


def measure(program, scene, folder, seeds, spp):
    """(error, seconds) of both samplers, which take turns."""
    sums = {"sobol": [0.0, 0.0], "independent": [0.0, 0.0]}
    render(program, scene, folder, 0, ["--spp", "1"])  # packs
    for seed in range(1, seeds + 1):
        for kind, total in sums.items():
            error, seconds = render(program, scene, folder, seed,
                                    ["--spp", str(spp), *(["--independent"] if kind == "independent" else [])])
            total[0] += error / seeds
            total[1] += seconds
    return sums


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--seeds", type=int, default=8)
    arguments = parser.parse_args()
    ratios = []
    print("| scene | error, Sobol' | error, independent | seconds | efficiency, Sobol' of independent |\n|---|---|---|---|---|")
    for scene in sorted((TESTS / "twins").glob("*.pbrt")):
        with tempfile.TemporaryDirectory() as folder:
            sums = measure(arguments.program.resolve(), scene, pathlib.Path(folder), arguments.seeds, arguments.spp)
        (sobol, sobol_seconds), (independent, independent_seconds) = sums["sobol"], sums["independent"]
        ratios.append(independent * independent_seconds / (sobol * sobol_seconds))
        print(f"| `{scene.stem}` | {sobol:.2e} | {independent:.2e} | {sobol_seconds:.2f} / {independent_seconds:.2f} "
              f"| {ratios[-1]:.2f} |", flush=True)
    print(f"\nGeometric mean {math.exp(sum(map(math.log, ratios)) / len(ratios)):.2f}, least {min(ratios):.2f}.")
    return 0 if min(ratios) >= 1 else 1


if __name__ == "__main__":
    sys.exit(main())
