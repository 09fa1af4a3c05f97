#!/usr/bin/env python3
"""Would the suite notice? Applies one-line faults, one at a time, to a copy of the sources, and runs the tests.

Each NAME.patch beside this file is a mutant: a line that says what is wrong, a line "Killed-by: LAYER [FILTER]" that
names the test program to ask first (and its tests), and a diff. First is asked the test that killed the mutant last
time, by the table of docs/testing.md, then all of its layer, then all layers. A mutant is killed when a test fails or
dies, or hangs twice; one that passes every program has SURVIVED: the suite has a hole. A patch that does not apply or
build is an ERROR, and so is one that the budget of --minutes left unjudged (LEFT, which fails nothing).

The copy, its one build directory and all that the tests leave lie in a temporary directory that is removed at the end;
the sources as they stand, committed or not, are only read. The tests of the table must pass on the unchanged
copy; so must, at the end, those that killed and were not in the table.
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
import time

MUTANTS = pathlib.Path(__file__).resolve().parent
SOURCES = MUTANTS.parent.parent
TABLE = SOURCES / "docs" / "testing.md"
LAYERS = ["shading", "cache", "pipeline", "failures", "tools"]  # the quickest first
TEST_SECONDS = 240  # several times what a whole program takes; twice as long when it is asked again


class Failure(Exception):
    pass


class OutOfTime(Exception):
    pass


def call(*command, timeout=None, **options):
    """The command's output; Failure when it fails, OutOfTime when it takes longer than `timeout` seconds."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                               start_new_session=True, **options)
    try:
        output, _ = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        raise OutOfTime() from None
    finally:
        end_group(process)
    if process.returncode != 0:
        raise Failure("\n".join([" ".join(map(str, command))] + output.splitlines()[-15:]))
    return output


def end_group(process):
    """Ends the process, and what it started."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    process.wait()


class Copy:
    """The sources, copied to `directory`, built and tested there until `deadline` (of time.monotonic())."""

    def __init__(self, directory, jobs, deadline):
        # As in a checkout, so that ccache finds what was compiled there: equal text, equal relative paths.
        self.tree, self.build, self.temporary = directory / "tree", directory / "tree" / "build", directory / "tmp"
        self.jobs, self.deadline = jobs, deadline
        self.temporary.mkdir(exist_ok=True)
        names = call("git", "-C", SOURCES, "ls-files", "-z", "--cached", "--others", "--exclude-standard").split("\0")
        for name in filter(None, names):
            if not (SOURCES / name).is_file():
                continue  # deleted, and not yet committed
            text, there = (SOURCES / name).read_bytes(), self.tree / name
            if there.is_file() and there.read_bytes() == text:
                continue  # --directory: what was compiled from it may still hold
            there.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(SOURCES / name, there)
            shutil.copymode(SOURCES / name, there)
        call("git", "init", "-q", self.tree)  # `git apply` looks for a repository
        self.environment = dict(os.environ, CCACHE_BASEDIR=str(directory), CCACHE_NOHASHDIR="1",
                                TMPDIR=str(self.temporary))

    def left(self):
        if self.deadline is not None and time.monotonic() > self.deadline:
            raise OutOfTime()
        return None if self.deadline is None else self.deadline - time.monotonic()

    def configure(self):
        call("cmake", "--preset", "release", "-DSPILLWAY_BENCH=OFF", cwd=self.tree, env=self.environment)

    def apply(self, patch, *options):
        call("git", "apply", *options, patch, cwd=self.tree)

    def fault(self, layer, tests="*"):
        """What is wrong with the layer, as the tests of its program see it; None when they pass."""
        call("cmake", "--build", self.build, "--target", f"{layer}_tests", "--parallel", str(self.jobs),
             env=self.environment, timeout=self.left())
        fault = self.run_tests(layer, tests, TEST_SECONDS)
        if fault and fault.endswith(" (hung)"):  # perhaps it was only slow beside other work
            print(f"{fault} after {TEST_SECONDS} s; asked again", flush=True)
            fault = self.run_tests(layer, tests, 2 * TEST_SECONDS)
        return fault

    def run_tests(self, layer, tests, seconds):
        process = subprocess.Popen([self.build / f"{layer}_tests", "--gtest_fail_fast", f"--gtest_filter={tests}"],
                                   cwd=self.build, env=self.environment, start_new_session=True,
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
        how = None
        try:
            output, _ = process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            how = "hung"
        finally:
            end_group(process)
        if how:
            output = process.communicate()[0] or ""
        elif process.returncode == 0:
            return None
        failed = re.search(r"^\[  FAILED  \] (\S+?)(?:,| \()", output, re.MULTILINE)
        if failed and not how:
            return f"{layer}: {failed[1]}"
        code = process.returncode
        how = how or ("ended by " + signal.Signals(-code).name if code < 0 else f"ended with code {code}")
        begun = re.findall(r"^\[ RUN      \] (\S+)", output, re.MULTILINE)
        return f"{layer}: {begun[-1] if begun else 'before the first test'} ({how})"


def hint_of(patch):
    """(layer, tests) that the patch names; all tests where it names none."""
    named = re.search(r"^Killed-by: (\w+) ?(\S*)$", patch.read_text(), re.MULTILINE)
    if not named or named[1] not in LAYERS:
        raise Failure(f"{patch.stem}: no line \"Killed-by: LAYER\" with one of {', '.join(LAYERS)}")
    return named[1], named[2] or "*"


class Killers:
    """The table of docs/testing.md: by which test each mutant was killed, as (layer, test); and its other words."""

    HEAD = "| fault | test |\n|---|---|\n"

    def __init__(self):
        self.rows = {}
        _, _, rest = TABLE.read_text().partition(self.HEAD)
        for name, by in re.findall(r"^\| `(\w+)` \| (.*) \|$", rest.partition("\n\n")[0], re.MULTILINE):
            self.rows[name] = by

    def known(self, patch):
        known = re.match(r"(\w+): (\S+\.\S+)", self.rows.get(patch.stem, ""))
        return (known[1], known[2]) if known and known[1] in LAYERS else None

    def of(self, patch):
        return self.known(patch) or hint_of(patch)

    def write(self, patch, result, by):
        self.rows[patch.stem] = by if result == "killed" else result
        names = sorted(p.stem for p in MUTANTS.glob("*.patch"))
        rows = [f"| `{name}` | {self.rows.get(name, 'not yet run')} |\n" for name in names]
        before, head, rest = TABLE.read_text().partition(self.HEAD)
        after = rest.partition("\n\n")[2]
        TABLE.write_text(before + head + "".join(rows) + "\n" + after)


def first_fault(copy, layer, tests):
    """By the tests that are asked first, by all of their layer, by all others."""
    fault = copy.fault(layer, tests)
    if fault is None and tests != "*":
        fault = copy.fault(layer)
    others = (other for other in LAYERS if other != layer)
    return fault or next(filter(None, map(copy.fault, others)), None)


def judge(copy, patch, killers):
    """(result, by which test)"""
    try:
        layer, tests = killers.of(patch)
        copy.left()
        copy.apply(patch)
    except (Failure, OutOfTime) as failure:
        return ("LEFT", "") if isinstance(failure, OutOfTime) else ("ERROR", str(failure))
    try:
        fault = first_fault(copy, layer, tests)
    except OutOfTime:
        return "LEFT", ""
    except Failure as failure:
        return "ERROR", str(failure)
    finally:
        copy.apply(patch, "--reverse")
    return ("killed", fault) if fault else ("SURVIVED", "")


def chosen(arguments, killers):
    patches = {patch.stem: patch for patch in sorted(MUTANTS.glob("*.patch"))}
    unknown = [name for name in arguments.names if name not in patches]
    if unknown:
        raise Failure(f"no mutant {', '.join(unknown)}; there are {', '.join(patches)}")
    names = arguments.names or list(patches)
    if arguments.sample:
        # Quick ones: the test is known, and one file is compiled.
        quick = [name for name in names if killers.known(patches[name]) and
                 not re.search(r"^\+\+\+ .*\.h$", patches[name].read_text(), re.MULTILINE)]
        names = random.Random(arguments.seed).sample(quick, min(arguments.sample, len(quick)))
    return [patches[name] for name in names]


def check(patches):
    """Prints which patches are no mutants of the sources as they stand."""
    bad = 0
    for patch in patches:
        try:
            hint_of(patch)
            call("git", "-C", SOURCES, "apply", "--check", patch)
        except Failure as failure:
            bad += 1
            print(f"{patch.stem}: {failure}")
    print(f"{len(patches)} mutants, {bad} of them do not apply", flush=True)
    return bad


def require_unchanged_passes(copy, asked):
    """Failure when one of the (layer, tests) fails without any mutant."""
    for layer in LAYERS:
        tests = sorted({tests for of, tests in asked if of == layer})
        fault = copy.fault(layer, "*" if "*" in tests else ":".join(tests)) if tests else None
        if fault:
            raise Failure(f"the unchanged sources do not pass: {fault}")


def run(arguments, directory):
    killers = Killers()
    patches = chosen(arguments, killers)
    bad = check(patches)
    if bad or arguments.check:
        return 2 if bad else 0
    deadline = time.monotonic() + 60 * arguments.minutes if arguments.minutes else None
    copy = Copy(pathlib.Path(directory).resolve(), arguments.jobs, deadline)
    copy.configure()
    asked = set(filter(None, map(killers.known, patches)))  # others have killed nothing yet
    print("the unchanged sources, by the tests of the table", flush=True)
    try:
        require_unchanged_passes(copy, asked)
    except OutOfTime:
        print(f"no mutant could be judged within {arguments.minutes} minutes")
        return 0
    width = max(len(patch.stem) for patch in patches)
    print(f"| {'mutant':{width}} | result   | seconds | by\n|-{'-' * width}-|----------|---------|---", flush=True)
    results, found = [], set()
    for patch in patches:
        begin = time.monotonic()
        result, by = judge(copy, patch, killers)
        results.append(result)
        found |= {killer for killer in re.findall(r"(\w+): (\S+\.\S+)", by) if result == "killed"}
        print(f"| {patch.stem:{width}} | {result:8} | {time.monotonic() - begin:7.0f} | {by}", flush=True)
        if arguments.write:
            killers.write(patch, result, by)
    copy.deadline = None
    require_unchanged_passes(copy, found - asked)
    print(", ".join(f"{results.count(result)} {result}" for result in ("killed", "SURVIVED", "ERROR", "LEFT")))
    return 0 if results.count("killed") + results.count("LEFT") == len(results) else 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="mutants to run; all of them by default")
    parser.add_argument("--check", action="store_true", help="only see whether the patches apply")
    parser.add_argument("--jobs", type=int, default=1, help="of the compiler; one by default")
    parser.add_argument("--sample", type=int, metavar="N", help="run N of the quick ones")
    parser.add_argument("--seed", default="", help="which N")
    parser.add_argument("--minutes", type=float, help="begin nothing after these, and break off what still compiles")
    parser.add_argument("--write", action="store_true", help="write each result into the table of docs/testing.md")
    parser.add_argument("--directory", help="where the copy is made, and stays; else a temporary one")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(2))  # so that the directory goes, whoever ends this
    with tempfile.TemporaryDirectory(prefix="spillway-mutants-") as directory:
        try:
            return run(arguments, arguments.directory or directory)
        except Failure as failure:
            print(failure, file=sys.stderr)
            return 2


if __name__ == "__main__":
    sys.exit(main())
