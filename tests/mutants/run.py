#!/usr/bin/env python3
"""Would the suite notice? Applies one-line faults, one at a time, to a copy of the sources, and runs the tests.

Each NAME.patch beside this file is a mutant: a line that says what is wrong, a line "Killed-by: LAYER" that names the
test program to ask first, and a diff. A mutant is killed when a test program fails, dies or hangs; one that passes
every program has SURVIVED: the suite has a hole. A patch that does not apply or build is an ERROR.

The copy, its one build directory and all that the tests leave lie in a temporary directory that is removed at the end;
the sources as they stand, committed or not, are only read. Before the first mutant the unchanged copy must pass.
Exit code 0 when every mutant was killed, 1 when one was not, 2 when there was nothing to judge.
"""

import argparse
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile

MUTANTS = pathlib.Path(__file__).resolve().parent
SOURCES = MUTANTS.parent.parent
LAYERS = ["shading", "cache", "pipeline", "failures", "tools"]  # the quickest first
TEST_SECONDS = 180  # as tests/run.sh allows; a hang counts as killed


class Failure(Exception):
    pass


def call(*command, **options):
    """The command's output; Failure when it fails."""
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, **options)
    if done.returncode != 0:
        raise Failure("\n".join([" ".join(map(str, command))] + done.stdout.splitlines()[-15:]))
    return done.stdout


class Copy:
    """The sources, copied to `directory`, built and tested there."""

    def __init__(self, directory, jobs):
        self.tree, self.build, self.temporary = directory / "tree", directory / "build", directory / "tmp"
        self.jobs = jobs
        self.temporary.mkdir()
        names = call("git", "-C", SOURCES, "ls-files", "-z", "--cached", "--others", "--exclude-standard").split("\0")
        for name in filter(None, names):
            if not (SOURCES / name).is_file():
                continue  # deleted, and not yet committed
            (self.tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(SOURCES / name, self.tree / name)
        call("git", "init", "-q", self.tree)  # `git apply` looks for a repository
        # Equal preprocessed text is found in ccache again, in whatever directory it was compiled.
        self.environment = dict(os.environ, CCACHE_BASEDIR=str(directory), CCACHE_NOHASHDIR="1",
                                TMPDIR=str(self.temporary))

    def configure(self):
        call("cmake", "--preset", "release", "-B", self.build, "-DSPILLWAY_BENCH=OFF", cwd=self.tree, env=self.environment)

    def apply(self, patch, *options):
        call("git", "apply", *options, patch, cwd=self.tree)

    def fault(self, layer):
        """What is wrong with the layer, as its test program sees it; None when it passes."""
        program = f"{layer}_tests"
        call("cmake", "--build", self.build, "--target", program, "--parallel", str(self.jobs), env=self.environment)
        process = subprocess.Popen([self.build / program, "--gtest_brief=1", "--gtest_fail_fast"], cwd=self.build,
                                   env=self.environment, start_new_session=True, stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True, errors="replace")
        try:
            output, _ = process.communicate(timeout=TEST_SECONDS)
        except subprocess.TimeoutExpired:
            return f"{program}: more than {TEST_SECONDS} s"
        finally:
            end_group(process)
        if process.returncode == 0:
            return None
        failed = re.search(r"^\[  FAILED  \] (\S+?)(?:,| \()", output, re.MULTILINE)
        if failed:
            return f"{layer}: {failed[1]}"
        code = process.returncode
        return f"{layer}: ended " + (f"by {signal.Signals(-code).name}" if code < 0 else f"with code {code}")


def end_group(process):
    """Ends the test program, and what it started."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    process.wait()


def first_fault(copy, layers):
    return next(filter(None, map(copy.fault, layers)), None)


def layers_of(patch):
    """All layers, those that the patch names first."""
    named = re.search(r"^Killed-by: (.*)$", patch.read_text(), re.MULTILINE)
    first = named[1].split() if named else []
    if not set(first) <= set(LAYERS):
        raise Failure(f"Killed-by: {' '.join(first)}: the layers are {', '.join(LAYERS)}")
    return first + [layer for layer in LAYERS if layer not in first]


def judge(copy, patch):
    """(result, by which test)"""
    try:
        layers = layers_of(patch)
        copy.apply(patch)
    except Failure as failure:
        return "ERROR", str(failure)
    try:
        fault = first_fault(copy, layers)
    except Failure as failure:
        return "ERROR", str(failure)
    finally:
        copy.apply(patch, "--reverse")
    return ("killed", fault) if fault else ("SURVIVED", "")


def chosen(arguments):
    patches = {patch.stem: patch for patch in sorted(MUTANTS.glob("*.patch"))}
    unknown = [name for name in arguments.names if name not in patches]
    if unknown:
        raise Failure(f"no mutant {', '.join(unknown)}; there are {', '.join(patches)}")
    names = arguments.names or list(patches)
    if arguments.sample:
        names = random.Random(arguments.seed).sample(names, min(arguments.sample, len(names)))
    return [patches[name] for name in names]


def run(arguments, directory):
    patches = chosen(arguments)
    copy = Copy(pathlib.Path(directory).resolve(), arguments.jobs)
    print(f"{len(patches)} mutants; first the unchanged sources", flush=True)
    copy.configure()
    fault = first_fault(copy, LAYERS)
    if fault:
        raise Failure(f"the unchanged sources do not pass: {fault}")
    width = max(len(patch.stem) for patch in patches)
    print(f"| {'mutant':{width}} | result   | by\n|-{'-' * width}-|----------|---", flush=True)
    results = []
    for patch in patches:
        result, by = judge(copy, patch)
        results.append(result)
        print(f"| {patch.stem:{width}} | {result:8} | {by}", flush=True)
    print(", ".join(f"{results.count(result)} {result}" for result in ("killed", "SURVIVED", "ERROR")))
    return 0 if results.count("killed") == len(results) else 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="mutants to run; all of them by default")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="of the compiler; one a processor by default")
    parser.add_argument("--sample", type=int, metavar="N", help="run N of them")
    parser.add_argument("--seed", type=int, default=0, help="which N")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(2))  # so that the directory goes, whoever ends this
    with tempfile.TemporaryDirectory(prefix="spillway-mutants-") as directory:
        try:
            return run(arguments, directory)
        except Failure as failure:
            print(failure, file=sys.stderr)
            return 2


if __name__ == "__main__":
    sys.exit(main())
