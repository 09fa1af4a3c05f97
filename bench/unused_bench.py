#!/usr/bin/env python3
"""What a feature costs a scene that does not use it: two programs or two sets of options on the same scene, in turns.

  bench/unused_bench.py A B SCENE [--a-options="..."] [--b-options="..."] [--repeat 7] [-- options of both]

A is a program without the feature, B one with it (or one program twice, with options that say what is asked for). Prints
the best and the median seconds of both, the ratio of the medians, and the noise: the ratio of two medians of A's own runs,
odd and even. The pictures must have the same bits. Exit code 1 when they do not.
"""

import argparse
import json
import pathlib
import shlex
import statistics
import subprocess
import sys
import tempfile


def render(program, scene, store, folder, options):
    """(seconds without opening, image hash)."""
    report = folder / "a.json"
    subprocess.run([program, "render", scene, "--store", store, "-o", folder / "a.exr", "--report", report, "-q", *options],
                   check=True)
    said = json.loads(report.read_text())
    return said["seconds"], said["image_hash"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("a", type=pathlib.Path)
    parser.add_argument("b", type=pathlib.Path)
    parser.add_argument("scene", type=pathlib.Path)
    parser.add_argument("--a-options", default="")
    parser.add_argument("--b-options", default="")
    parser.add_argument("--repeat", type=int, default=7)
    words = sys.argv[1:]
    split = words.index("--") if "--" in words else len(words)
    of_both = words[split + 1:]
    arguments = parser.parse_args(words[:split])
    seconds, hashes = {"a": [], "b": []}, set()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        sides = {"a": (arguments.a.resolve(), arguments.a_options), "b": (arguments.b.resolve(), arguments.b_options)}
        for turn in range(2 * arguments.repeat + 1):  # A once more: its odd and even runs lie around those of B
            side = "ab"[turn % 2]
            program, options = sides[side]
            store = folder / f"{side}.store"
            if turn < 2:
                render(program, arguments.scene, store, folder, ["--spp", "1"])  # packs
            took, image = render(program, arguments.scene, store, folder, [*of_both, *shlex.split(options)])
            seconds[side].append(took)
            hashes.add(image)
    median = {side: statistics.median(took) for side, took in seconds.items()}
    noise = statistics.median(seconds["a"][::2]) / statistics.median(seconds["a"][1::2])
    print("| scene | A: best, median s | B: best, median s | B of A | A of A |\n|---|---|---|---|---|")
    print(f"| `{arguments.scene.stem}` | {min(seconds['a']):.3f}, {median['a']:.3f} | {min(seconds['b']):.3f}, "
          f"{median['b']:.3f} | {median['b'] / median['a']:.3f} | {noise:.3f} |")
    if len(hashes) > 1:
        print("the pictures differ")
    return 0 if len(hashes) == 1 else 1


if __name__ == "__main__":
    sys.exit(main())
