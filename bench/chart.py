"""Charts as SVG text: lines over a logarithmic or linear axis, and bars. No libraries."""
import math

COLOURS = ['#1f5fa8', '#c2512f', '#3d8a4a', '#7a4fa3', '#8a7a2a']
LEFT, TOP, WIDTH, HEIGHT = 70, 30, 520, 280


def text(x, y, words, anchor='middle', size=12):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}">{words}</text>'


def frame(title, x_label, y_label, body):
    return '\n'.join([
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{LEFT + WIDTH + 30}" height="{TOP + HEIGHT + 60}" '
        'font-family="sans-serif" fill="#222">',
        '<rect width="100%" height="100%" fill="white"/>',
        text(LEFT + WIDTH / 2, 18, title, size=14),
        text(LEFT + WIDTH / 2, TOP + HEIGHT + 45, x_label),
        f'<g transform="translate(16,{TOP + HEIGHT / 2}) rotate(-90)">{text(0, 0, y_label)}</g>',
        f'<rect x="{LEFT}" y="{TOP}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#888"/>',
        *body, '</svg>', ''])


class Axis:
    def __init__(self, values, low, high, logarithmic=False, floor=None):
        self.log = math.log10 if logarithmic else lambda v: v
        first, last = min(values), max(values)
        if floor is not None:
            first = min(first, floor)
        self.first, self.last = self.log(first), self.log(last) if last > first else self.log(first) + 1
        self.low, self.high = low, high

    def __call__(self, value):
        return self.low + (self.log(value) - self.first) / (self.last - self.first) * (self.high - self.low)


def lines(title, x_label, y_label, series, logarithmic=(False, False), y_floor=0):
    """series: {name: [(x, y)]}; logarithmic: of x and y."""
    xs = [x for points in series.values() for x, _ in points]
    ys = [y for points in series.values() for _, y in points]
    x_axis = Axis(xs, LEFT + 20, LEFT + WIDTH - 20, logarithmic[0])
    top = [max(ys) * 1.1]
    y_axis = Axis(ys + top, TOP + HEIGHT - 10, TOP + 10, logarithmic[1], None if logarithmic[1] else y_floor)
    body = []
    for value in sorted(set(xs)):
        body.append(text(x_axis(value), TOP + HEIGHT + 18, f'{value:g}', size=11))
    span = [y_floor + (max(ys) * 1.1 - y_floor) * i / 4 for i in range(5)] if not logarithmic[1] else sorted(set(ys))
    for value in span:
        y = y_axis(value) if value > 0 or not logarithmic[1] else TOP + HEIGHT - 10
        body.append(text(LEFT - 6, y + 4, f'{value:.3g}', 'end', 11))
        body.append(f'<line x1="{LEFT}" x2="{LEFT + WIDTH}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ddd"/>')
    for index, (name, points) in enumerate(series.items()):
        colour = COLOURS[index % len(COLOURS)]
        path = ' '.join(f'{x_axis(x):.1f},{y_axis(y):.1f}' for x, y in sorted(points))
        body.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
        for x, y in points:
            body.append(f'<circle cx="{x_axis(x):.1f}" cy="{y_axis(y):.1f}" r="3.5" fill="{colour}"/>')
        body.append(f'<rect x="{LEFT + WIDTH - 150}" y="{TOP + 12 + 18 * index}" width="12" height="12" fill="{colour}"/>')
        body.append(text(LEFT + WIDTH - 132, TOP + 22 + 18 * index, name, 'start'))
    return frame(title, x_label, y_label, body)


def bars(title, y_label, values):
    """values: [(name, y)]"""
    top = max(y for _, y in values) * 1.15
    step = WIDTH / len(values)
    body = []
    for index, (name, y) in enumerate(values):
        x, height = LEFT + step * index, HEIGHT * y / top
        body.append(f'<rect x="{x + 0.15 * step:.1f}" y="{TOP + HEIGHT - height:.1f}" width="{0.7 * step:.1f}" '
                    f'height="{height:.1f}" fill="{COLOURS[0]}"/>')
        body.append(text(x + step / 2, TOP + HEIGHT - height - 5, f'{y:.2f}', size=11))
        for line, word in enumerate(name.split('|')):
            body.append(text(x + step / 2, TOP + HEIGHT + 14 + 12 * line, word, size=10))
    return frame(title, '', y_label, body)
