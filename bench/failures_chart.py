#!/usr/bin/env python3
"""Charts the scenes whose error falls slowly: failures_chart.py build/failures_bench docs/images/failures.svg

Runs the program, writes its CSV beside the chart, and prints the slope fitted to each scene's error.
"""
import csv
import math
import pathlib
import subprocess
import sys

import chart


def slope(points):
    """Of the least squares line through the logarithms, the first point left out: it may not be converging yet."""
    xs, ys = zip(*[(math.log(x), math.log(y)) for x, y in points[1:]])
    x, y = sum(xs) / len(xs), sum(ys) / len(ys)
    return sum((a - x) * (b - y) for a, b in zip(xs, ys)) / sum((a - x) ** 2 for a in xs)


def main():
    program, out = sys.argv[1], pathlib.Path(sys.argv[2])
    text = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    out.with_suffix('.csv').write_text(text)
    series = {}
    rows = list(csv.reader(text.splitlines()))[1:]
    for row in rows:
        name, samples, error = ','.join(row[:-2]), row[-2], row[-1]
        series.setdefault(name, []).append((int(samples), float(error)))
    for name, points in series.items():
        print(f'{name}: {slope(points):.2f}')
    out.write_text(chart.lines('Mean relative deviation of a frame', 'samples', '', series, (True, True)))


if __name__ == '__main__':
    main()
