#!/usr/bin/env python3
"""Writes the demo scene `courtyard`: an evening courtyard in pbrt-v4's text format, with PLY meshes and PNG textures.

    python3 make_courtyard.py [folder]        (default: courtyard, beside this file)

Needs nothing but Python's standard library; the same bytes every time. Units are metres, y is up.
"""

import math
import os
import random
import struct
import sys
import zlib

# ---------------------------------------------------------------- vectors


def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scaled(a, s):
    return (a[0] * s, a[1] * s, a[2] * s)


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    n = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    return (a[0] / n, a[1] / n, a[2] / n) if n > 0 else (0.0, 1.0, 0.0)


# ---------------------------------------------------------------- meshes


class Mesh:
    """Vertices with normals and uvs, and triangles wound counter-clockwise as seen from outside."""

    def __init__(self):
        self.points, self.normals, self.uvs, self.triangles = [], [], [], []

    def vertex(self, p, n, uv):
        self.points.append(p)
        self.normals.append(n)
        self.uvs.append(uv)
        return len(self.points) - 1

    def grid(self, rows, columns, vertex):
        """vertex(i, j) -> (point, normal, uv); cross(d/di, d/dj) points outside."""
        first = len(self.points)
        for i in range(rows + 1):
            for j in range(columns + 1):
                self.vertex(*vertex(i, j))
        at = lambda i, j: first + i * (columns + 1) + j
        for i in range(rows):
            for j in range(columns):
                self.triangle(at(i, j), at(i + 1, j), at(i + 1, j + 1))
                self.triangle(at(i, j), at(i + 1, j + 1), at(i, j + 1))

    def triangle(self, a, b, c):
        area = cross(sub(self.points[b], self.points[a]), sub(self.points[c], self.points[a]))
        if max(abs(x) for x in area) > 1e-12:
            self.triangles.append((a, b, c))

    def quad(self, origin, along_u, along_v, u=1.0, v=1.0):
        """Corner, two edges; outside is cross(along_u, along_v)."""
        n = unit(cross(along_u, along_v))
        p = [origin, add(origin, along_u), add(add(origin, along_u), along_v), add(origin, along_v)]
        i = [self.vertex(q, n, t) for q, t in zip(p, [(0, 0), (u, 0), (u, v), (0, v)])]
        self.triangle(i[0], i[1], i[2])
        self.triangle(i[0], i[2], i[3])

    def box(self, low, high, texels=1.0):
        x, y, z = sub(high, low)
        self.quad(low, (0, y, 0), (x, 0, 0), y * texels, x * texels)
        self.quad((low[0], low[1], high[2]), (x, 0, 0), (0, y, 0), x * texels, y * texels)
        self.quad(low, (0, 0, z), (0, y, 0), z * texels, y * texels)
        self.quad((high[0], low[1], low[2]), (0, y, 0), (0, 0, z), y * texels, z * texels)
        self.quad(low, (x, 0, 0), (0, 0, z), x * texels, z * texels)
        self.quad((low[0], high[1], low[2]), (0, 0, z), (x, 0, 0), z * texels, x * texels)

    def lathe(self, profile, around, u_repeat=1.0):
        """Polyline (radius, height), turned about y; outside is to the right of its direction."""
        lengths = [0.0]
        for (r0, y0), (r1, y1) in zip(profile, profile[1:]):
            lengths.append(lengths[-1] + math.hypot(r1 - r0, y1 - y0))

        def vertex(i, j):
            before, after = profile[max(i - 1, 0)], profile[min(i + 1, len(profile) - 1)]
            dr, dy = after[0] - before[0], after[1] - before[1]
            phi = 2 * math.pi * (j % around) / around
            c, s = math.cos(phi), math.sin(phi)
            r, y = profile[i]
            return ((r * c, y, r * s), unit((dy * c, -dr, dy * s)), (u_repeat * j / around, lengths[i] / lengths[-1]))

        self.grid(len(profile) - 1, around, vertex)

    def tube(self, path, radius, around, closed=False):
        """A round tube along points; its frame is carried from point to point."""
        n = len(path)
        tangents = []
        for i in range(n):
            a, b = (path[i - 1], path[(i + 1) % n]) if closed else (path[max(i - 1, 0)], path[min(i + 1, n - 1)])
            tangents.append(unit(sub(b, a)))
        side = unit(cross(tangents[0], (0.31, 0.95, 0.07)))
        frames = []
        for t in tangents:
            side = unit(sub(side, scaled(t, side[0] * t[0] + side[1] * t[1] + side[2] * t[2])))
            frames.append((side, cross(t, side)))

        def vertex(i, j):
            k = i % n
            a, b = frames[k]
            phi = 2 * math.pi * (j % around) / around
            out = add(scaled(a, math.cos(phi)), scaled(b, math.sin(phi)))
            return (add(path[k], scaled(out, radius)), out, (j / around, i / n))

        first = len(self.triangles)
        self.grid(n if closed else n - 1, around, vertex)
        self.triangles[first:] = [(a, c, b) for a, b, c in self.triangles[first:]]

    def sphere(self, center, radius, rows, columns):
        def vertex(i, j):
            theta, phi = math.pi * (1 - i / rows), 2 * math.pi * (j % columns) / columns
            n = (math.sin(theta) * math.cos(phi), math.cos(theta), math.sin(theta) * math.sin(phi))
            if i in (0, rows):
                n = (0.0, -1.0 if i == 0 else 1.0, 0.0)
            return (add(center, scaled(n, radius)), n, (j / columns, i / rows))

        self.grid(rows, columns, vertex)

    def write(self, path):
        with open(path, "wb") as out:
            out.write(("ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(self.points)).encode())
            for name in ("x", "y", "z", "nx", "ny", "nz", "u", "v"):
                out.write(("property float %s\n" % name).encode())
            out.write(("element face %d\nproperty list uchar ushort vertex_indices\n" % len(self.triangles)).encode())
            out.write(b"end_header\n")
            for p, n, uv in zip(self.points, self.normals, self.uvs):
                out.write(struct.pack("<8f", *p, *n, *uv))
            for t in self.triangles:
                out.write(struct.pack("<B3H", 3, *t))


def curve(points, steps):
    """Catmull-Rom through points, `steps` pieces between two of them."""
    out = []
    for k in range(len(points) - 1):
        p = [points[max(k - 1, 0)], points[k], points[k + 1], points[min(k + 2, len(points) - 1)]]
        for s in range(steps):
            t = s / steps
            w = ((-t + 2 * t * t - t**3) / 2, (2 - 5 * t * t + 3 * t**3) / 2, (t + 4 * t * t - 3 * t**3) / 2,
                 (t**3 - t * t) / 2)
            out.append(tuple(sum(w[i] * p[i][c] for i in range(4)) for c in range(len(points[0]))))
    return out + [points[-1]]


# ---------------------------------------------------------------- pictures


def write_png(path, width, height, channels, pixel):
    """pixel(x, y) -> values in [0, 1] (already encoded); rows from the top."""
    rows = bytearray()
    for y in range(height):
        row = bytearray()
        for x in range(width):
            value = pixel(x, y)
            for v in value if channels == 3 else (value,):
                row.append(max(0, min(255, int(v * 255 + 0.5))))
        rows.append(1)  # filter: difference to the left
        rows += bytes((row[i] - (row[i - channels] if i >= channels else 0)) & 255 for i in range(len(row)))
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    with open(path, "wb") as out:
        out.write(b"\x89PNG\r\n\x1a\n")
        out.write(chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2 if channels == 3 else 0, 0, 0, 0)))
        out.write(chunk(b"IDAT", zlib.compress(bytes(rows), 9)))
        out.write(chunk(b"IEND", b""))


def hashed(*key):
    h = 0x9E3779B9
    for k in key:
        h = ((h ^ (k & 0xFFFFFFFF)) * 0x85EBCA6B) & 0xFFFFFFFF
        h ^= h >> 13
        h = (h * 0xC2B2AE35) & 0xFFFFFFFF
        h ^= h >> 16
    return h / 4294967296.0


def smoothstep(a, b, x):
    t = max(0.0, min(1.0, (x - a) / (b - a)))
    return t * t * (3 - 2 * t)


def noise(x, y, period, seed):
    """Value noise in [0, 1] on integer cells, repeating with `period`."""
    i, j = math.floor(x), math.floor(y)
    fx, fy = smoothstep(0, 1, x - i), smoothstep(0, 1, y - j)
    at = lambda a, b: hashed(a % period, b % period, seed)
    low = at(i, j) * (1 - fx) + at(i + 1, j) * fx
    return low * (1 - fy) + (at(i, j + 1) * (1 - fx) + at(i + 1, j + 1) * fx) * fy


def turbulence(u, v, period, octaves, seed):
    total, weight, sum_of_weights = 0.0, 1.0, 0.0
    for o in range(octaves):
        total += weight * noise(u * period, v * period, period, seed + o)
        sum_of_weights += weight
        period *= 2
        weight *= 0.5
    return total / sum_of_weights


def mixed(a, b, t):
    return tuple(x * (1 - t) + y * t for x, y in zip(a, b))


# ---------------------------------------------------------------- textures


def brick_textures(folder):
    size, rows, columns = 256, 8, 4

    def look(x, y):
        u, v = x / size, y / size
        wobble = 0.006 * (noise(u * 32, v * 32, 32, 5) - 0.5)
        row = int(v * rows)
        bu = (u + wobble) * columns + (0.5 if row % 2 else 0.0)
        column, fu, fv = math.floor(bu) % columns, bu - math.floor(bu), v * rows - row
        edge = min(min(fu, 1 - fu) * 2.0, min(fv, 1 - fv)) + 0.05 * (noise(u * 64, v * 64, 64, 6) - 0.5)
        inside = smoothstep(0.05, 0.12, edge)
        shade = hashed(row, column, 1)
        brick = mixed((0.50, 0.25, 0.19), (0.66, 0.40, 0.29), shade)
        if hashed(row, column, 2) > 0.82:
            brick = scaled(brick, 0.68)
        grain = 0.86 + 0.24 * turbulence(u, v, 16, 3, 9)
        return inside, scaled(brick, grain), shade

    def colour(x, y):
        inside, brick, _ = look(x, y)
        return mixed(scaled((0.60, 0.56, 0.51), 0.85 + 0.2 * noise(x / 4, y / 4, 64, 3)), brick, inside)

    def height(x, y):
        inside, _, shade = look(x, y)
        return inside * (0.75 + 0.15 * shade) + 0.1 * turbulence(x / size, y / size, 32, 2, 11)

    write_png(folder + "/brick.png", size, size, 3, lambda x, y: mixed((0, 0, 0), colour(x, y), 1))
    write_png(folder + "/brick_height.png", size, size, 1, height)


def paving_textures(folder):
    size, cells = 384, 6

    def look(x, y):
        u, v = x / size * cells, y / size * cells
        i, j = math.floor(u), math.floor(v)
        found = []
        for a in (i - 1, i, i + 1):
            for b in (j - 1, j, j + 1):
                px = a + 0.5 + 0.62 * (hashed(a % cells, b % cells, 21) - 0.5)
                py = b + 0.5 + 0.62 * (hashed(a % cells, b % cells, 22) - 0.5)
                found.append((max(abs(u - px), abs(v - py)) * 0.5 + math.hypot(u - px, v - py) * 0.5, a, b))
        found.sort()
        gap = found[1][0] - found[0][0] + 0.03 * (noise(u * 8, v * 8, cells * 8, 23) - 0.5)
        return smoothstep(0.03, 0.13, gap), hashed(found[0][1] % cells, found[0][2] % cells, 24)

    def colour(x, y):
        inside, shade = look(x, y)
        grain = 0.82 + 0.3 * turbulence(x / size, y / size, 24, 3, 25)
        stone = scaled(mixed((0.46, 0.43, 0.40), (0.60, 0.55, 0.48), shade), grain)
        return mixed((0.16, 0.17, 0.13), stone, inside)

    def height(x, y):
        inside, shade = look(x, y)
        return inside * (0.6 + 0.2 * shade) + 0.2 * turbulence(x / size, y / size, 12, 4, 26) * inside

    write_png(folder + "/paving.png", size, size, 3, colour)
    write_png(folder + "/paving_height.png", size, size, 1, height)


def wood_texture(folder):
    def colour(x, y):
        u, v = x / 256, y / 256
        ring = turbulence(u, v, 2, 3, 31) * 5 + v * 9
        stripe = 0.5 + 0.5 * math.sin(2 * math.pi * ring)
        grain = noise(u * 8, v * 128, 128, 32)
        plank = 0.88 + 0.2 * hashed(int(v * 6), 33)
        line = smoothstep(0.0, 0.03, min((v * 6) % 1, 1 - (v * 6) % 1))
        base = mixed((0.54, 0.33, 0.19), (0.76, 0.53, 0.31), 0.6 * stripe + 0.4 * grain)
        return scaled(base, plank * (0.35 + 0.65 * line))

    write_png(folder + "/wood.png", 256, 256, 3, colour)


def rust_textures(folder):
    write_png(folder + "/rust.png", 192, 192, 1,
              lambda x, y: smoothstep(0.46, 0.56, turbulence(x / 192, y / 192, 5, 5, 41)))
    blue = lambda x, y: (y + 5 * math.sin(2 * math.pi * x / 32)) % 32 <= 20
    write_png(folder + "/stripes.png", 64, 64, 3,
              lambda x, y: (0.16, 0.30, 0.58) if blue(x, y) else (0.94, 0.92, 0.86))


def fence_texture(folder):
    """One panel between two posts: bars, rails, rings and spear heads; 1 is iron."""
    size = 256

    def covered(u, v):
        bars = 6
        f = (u * bars) % 1 - 0.5
        d = []
        if v < 0.90:
            d.append(abs(f) / bars - 0.0085)  # a bar
        d.append(max(abs(f) / bars - 0.024 * max(0.0, (0.99 - v) / 0.09), 0.90 - v, v - 0.99))  # its spear head
        for rail in (0.06, 0.70, 0.86):
            d.append(abs(v - rail) - 0.012)
        cell = (u * bars + 0.5) % 1 - 0.5
        d.append(abs(math.hypot(cell / bars, v - 0.78) - 0.058) - 0.009)  # rings between the upper rails
        s = (u * 3) % 1 - 0.5
        for sign in (-1, 1):  # scrolls above the lower rail
            d.append(abs(math.hypot(s / 3 - sign * 0.085, (v - 0.16)) - 0.07) - 0.008)
        d.append(min(u, 1 - u) - 0.010)  # a post
        return min(d)

    write_png(folder + "/fence_alpha.png", size, size, 1,
              lambda x, y: smoothstep(0.003, -0.003, covered((x + 0.5) / size, 1 - (y + 0.5) / size)))


def leaf_textures(folder):
    size = 128

    def blade(u, v):
        half = 0.46 * math.sin(math.pi * min(1.0, max(0.0, v)) ** 0.72) ** 0.8
        return half - abs(u - 0.5) + 0.012 * math.sin(v * 60)

    def leaf_colour(x, y):
        u, v = (x + 0.5) / size, 1 - (y + 0.5) / size
        vein = max(smoothstep(0.02, 0.0, abs(u - 0.5)),
                   0.7 * smoothstep(0.12, 0.0, abs(((v - 0.8 * abs(u - 0.5)) * 9) % 1 - 0.5)))
        base = mixed((0.13, 0.32, 0.10), (0.32, 0.50, 0.16), turbulence(u, v, 6, 3, 51))
        return mixed(base, (0.50, 0.60, 0.30), 0.55 * vein)

    def ivy(u, v):
        x, y = u - 0.5, v - 0.42
        phi, r = math.atan2(x, y), math.hypot(x, y)
        lobes = 0.27 + 0.17 * abs(math.cos(2.5 * phi)) ** 0.8 * (0.75 + 0.25 * math.cos(phi))
        return max(lobes - r, 0.018 - abs(x) if v < 0.42 else -1)

    at = lambda f: lambda x, y: smoothstep(-0.012, 0.012, f((x + 0.5) / size, 1 - (y + 0.5) / size))
    write_png(folder + "/leaf.png", size, size, 3, leaf_colour)
    write_png(folder + "/leaf_alpha.png", size, size, 1, at(blade))
    write_png(folder + "/ivy_alpha.png", size, size, 1, at(ivy))


# ---------------------------------------------------------------- models


def arc(center, radius, begin_deg, end_deg, steps):
    return [(center[0] + radius * math.cos(math.radians(begin_deg + (end_deg - begin_deg) * k / steps)),
             center[1] + radius * math.sin(math.radians(begin_deg + (end_deg - begin_deg) * k / steps)))
            for k in range(steps + 1)]


def revolved(profile, around, u_repeat=1.0):
    mesh = Mesh()
    mesh.lathe(profile, around, u_repeat)
    return mesh


def table_top():
    mesh = Mesh()
    rim = [(0.56, 0.70)] + arc((0.60, 0.725), 0.025, -90, 90, 8) + [(0.56, 0.75)]
    mesh.lathe(rim, 96, 6)
    mesh.lathe([(0.0, 0.70), (0.56, 0.70)], 48)
    top = Mesh()  # a disc with straight planks: uv from above
    top.lathe([(0.56, 0.75), (0.28, 0.75), (0.0, 0.75)], 96)
    top.uvs = [(0.5 + p[0] / 1.2, 0.5 + p[2] / 1.2) for p in top.points]
    return mesh, top


def leaf_blade(length, width, bend, pieces):
    """A bent strip from the origin along +z and up; uv v runs along it."""
    mesh = Mesh()
    points = []
    y, z, slope = 0.0, 0.0, math.radians(70)
    for i in range(pieces + 1):
        points.append((y, z, slope))
        y += math.sin(slope) * length / pieces
        z += math.cos(slope) * length / pieces
        slope -= math.radians(bend) / pieces

    def vertex(i, j):
        py, pz, s = points[i]
        fold = 0.18 * width * abs(j - 1)
        up = (0.0, math.cos(s), -math.sin(s))
        return (add(((j - 1) * width / 2, py, pz), scaled(up, fold)), up, (j / 2, i / pieces))

    mesh.grid(pieces, 2, vertex)
    return mesh


def append(into, mesh, turn_deg, tilt_deg=0.0, size=1.0, offset=(0, 0, 0)):
    """Adds a copy: tilted about x, turned about y, moved."""
    ct, st = math.cos(math.radians(tilt_deg)), math.sin(math.radians(tilt_deg))
    cy, sy = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))

    def turned(p):
        x, y, z = p[0], p[1] * ct - p[2] * st, p[1] * st + p[2] * ct
        return (x * cy + z * sy, y, -x * sy + z * cy)

    base = len(into.points)
    for p, n, uv in zip(mesh.points, mesh.normals, mesh.uvs):
        into.vertex(add(scaled(turned(p), size), offset), turned(n), uv)
    into.triangles += [(a + base, b + base, c + base) for a, b, c in mesh.triangles]


def plant(rng):
    mesh = Mesh()
    for k in range(34):
        blade = leaf_blade(0.42 + 0.28 * rng.random(), 0.13 + 0.05 * rng.random(), 70 + 70 * rng.random(), 7)
        append(mesh, blade, 137.508 * k, 18 - 34 * k / 34, 1.0, (0, 0.33 + 0.002 * k, 0))
    return mesh


def ivy_cluster(rng):
    """Leaves on the plane z = 0, facing -z."""
    mesh = Mesh()
    for _ in range(16):
        size = 0.07 + 0.06 * rng.random()
        turn, tip = rng.uniform(-1.1, 1.1), rng.uniform(0.2, 0.8)
        c, s = math.cos(turn), math.sin(turn)
        right = (c * size, s * size, rng.uniform(-0.3, 0.3) * size)
        up = (s * size * math.cos(tip), -c * size * math.cos(tip), -size * math.sin(tip))
        origin = (rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), -0.01 - 0.05 * rng.random())
        mesh.quad(sub(origin, scaled(add(right, up), 0.5)), right, up)
    return mesh


def torus_knot(center, scale):
    path = []
    for k in range(200):
        t = 2 * math.pi * k / 200
        r = 2 + math.cos(3 * t)
        path.append(add(center, scaled((r * math.cos(2 * t), math.sin(3 * t) * 1.25, r * math.sin(2 * t)), scale)))
    mesh = Mesh()
    mesh.tube(path, 0.55 * scale, 12, closed=True)
    return mesh


def cypress(rng):
    mesh = Mesh()
    profile = curve([(0.001, 0.0), (0.34, 0.35), (0.42, 1.0), (0.30, 2.4), (0.10, 3.5), (0.001, 3.9)], 6)
    mesh.lathe(profile, 28)
    for i, (p, n) in enumerate(zip(mesh.points, mesh.normals)):
        around, row = i % 29 % 28, i // 29
        bump = 0.10 * (hashed(around, row, 61) - 0.5)
        mesh.points[i] = add(p, scaled(n, bump))
    return mesh


def meshes():
    rng = random.Random(7)
    out = {}
    rim, top = table_top()
    out["table_rim"], out["table_top"] = rim, top
    foot = curve([(0.30, 0.0), (0.30, 0.03), (0.10, 0.07), (0.05, 0.18), (0.075, 0.34), (0.045, 0.50), (0.09, 0.64),
                  (0.22, 0.70)], 6)
    out["table_foot"] = revolved(foot, 40)
    stool = curve([(0.001, 0.40), (0.17, 0.40), (0.185, 0.425), (0.17, 0.45), (0.001, 0.455)], 5)
    out["stool_seat"] = revolved(stool, 48, 2)
    legs = Mesh()
    for k in range(4):
        c, s = math.cos(math.pi * (k / 2 + 0.25)), math.sin(math.pi * (k / 2 + 0.25))
        legs.tube([(0.12 * c, 0.41, 0.12 * s), (0.17 * c, 0.2, 0.17 * s), (0.19 * c, 0.0, 0.19 * s)], 0.014, 8)
    out["stool_legs"] = legs
    outer = [(0.001, 0.0), (0.07, 0.0), (0.085, 0.012), (0.10, 0.10), (0.085, 0.20), (0.045, 0.28), (0.042, 0.32),
             (0.062, 0.36)]
    inner = [(0.056, 0.36), (0.036, 0.32), (0.039, 0.28), (0.078, 0.20), (0.092, 0.10), (0.075, 0.022), (0.001, 0.018)]
    vase = curve(outer, 4)[:-1] + [(0.061, 0.3615), (0.059, 0.363), (0.057, 0.3615)] + curve(inner, 4)
    out["vase"] = revolved(vase, 64)
    ball = Mesh()
    ball.sphere((0, 0, 0), 1.0, 40, 80)
    out["ball"] = ball
    fruit = Mesh()
    fruit.sphere((0, 0, 0), 1.0, 16, 28)
    for i, p in enumerate(fruit.points):
        dent = 0.14 * math.exp(-6 * (p[0] * p[0] + p[2] * p[2])) * (1 if p[1] > 0 else 0.4)
        fruit.points[i] = (p[0], p[1] * (0.92 - dent), p[2])
    out["fruit"] = fruit
    bowl = curve([(0.001, 0.0), (0.07, 0.0), (0.075, 0.012), (0.15, 0.05), (0.195, 0.115)], 6)
    bowl += [(0.197, 0.119), (0.194, 0.121), (0.190, 0.118)]
    bowl += curve([(0.188, 0.114), (0.145, 0.056), (0.08, 0.022), (0.001, 0.018)], 6)
    out["bowl"] = revolved(bowl, 64)
    cup = curve([(0.001, 0.0), (0.028, 0.0), (0.03, 0.006), (0.044, 0.03), (0.046, 0.072)], 5)
    cup += [(0.0455, 0.074), (0.0445, 0.074)]
    cup += curve([(0.043, 0.072), (0.041, 0.03), (0.028, 0.009), (0.001, 0.007)], 5)
    out["cup"] = revolved(cup, 48, 4)
    handle = Mesh()
    handle.tube(curve([(0.043, 0.060, 0), (0.066, 0.058, 0), (0.070, 0.036, 0), (0.058, 0.020, 0),
                       (0.040, 0.022, 0)], 5), 0.0045, 8)
    out["cup_handle"] = handle
    saucer = curve([(0.001, 0.0), (0.035, 0.0), (0.075, 0.012), (0.078, 0.014), (0.075, 0.016), (0.035, 0.005),
                    (0.001, 0.005)], 5)
    out["saucer"] = revolved(saucer, 48, 6)
    jar = [(0.125, 0.0), (0.125, 0.20)] + arc((0.0, 0.20), 0.125, 0, 90, 14)[1:]
    out["bell_jar"] = revolved(jar, 56)
    out["bell_base"] = revolved([(0.001, 0.0), (0.145, 0.0)] + arc((0.145, 0.012), 0.012, -90, 90, 6) +
                                [(0.145, 0.024), (0.001, 0.024)], 56)
    out["knot"] = torus_knot((0, 0.14, 0), 0.030)
    pot = [(0.001, 0.0), (0.14, 0.0), (0.145, 0.01), (0.19, 0.30), (0.215, 0.30), (0.22, 0.305), (0.22, 0.36),
           (0.215, 0.365), (0.185, 0.365), (0.18, 0.36), (0.178, 0.32), (0.001, 0.33)]
    out["pot"] = revolved([q for p in zip(pot, pot[1:]) for q in (p[0], mixed(p[0], p[1], 0.98))] + [pot[-1]], 56, 2)
    out["plant"] = plant(rng)
    amphora = curve([(0.001, 0.0), (0.13, 0.0), (0.15, 0.03), (0.27, 0.32), (0.26, 0.55), (0.12, 0.76), (0.10, 0.84),
                     (0.15, 0.90)], 5)
    amphora += [(0.152, 0.905), (0.148, 0.91), (0.14, 0.905)] + curve([(0.13, 0.89), (0.085, 0.83), (0.10, 0.76)], 4)
    out["amphora"] = revolved(amphora, 56, 2)
    lantern = curve([(0.05, -0.15), (0.12, -0.11), (0.15, 0.0), (0.12, 0.11), (0.05, 0.15)], 3)
    out["lantern"] = revolved(lantern, 24)
    caps = Mesh()
    for y in (-0.165, 0.15):
        caps.lathe([(0.001, y), (0.055, y), (0.055, y + 0.015), (0.001, y + 0.015)], 20)
    out["lantern_caps"] = caps
    out["ivy"] = ivy_cluster(rng)
    out["cypress"] = cypress(rng)
    cable = Mesh()
    cable.tube([cable_point(k / 40) for k in range(41)], 0.006, 6)
    out["cable"] = cable
    lamp = curve([(0.16, 0.0), (0.10, 0.07), (0.035, 0.12), (0.03, 0.16), (0.001, 0.165)], 5)
    out["lamp_shade"] = revolved(lamp, 40)
    arm = Mesh()
    arm.tube(curve([(0, 0.16, 0), (0, 0.24, 0.05), (0, 0.24, 0.22), (0, 0.10, 0.28)], 8), 0.011, 8)
    out["lamp_arm"] = arm
    out.update(building())
    return out


def cable_point(t):
    return (-2.9 + 6.0 * t, 2.55 - 1.9 * t * (1 - t), 2.3 - 2.1 * t)


BACK, RIGHT, LEFT, NEAR = 2.9, 2.4, -2.6, -4.0  # z of the back wall, x of right wall and fence, z where all ends
TILE = 1.1  # metres a repetition of the bricks


def building():
    out = {}
    back = Mesh()  # faces -z; a window at x -1.75 .. -0.75, y 0.95 .. 2.05; a doorway at x 0.75 .. 1.75, height 2.1
    wall = lambda x0, y0, x1, y1: back.quad((x1, y0, BACK), (x0 - x1, 0, 0), (0, y1 - y0, 0), (x1 - x0) / TILE,
                                            (y1 - y0) / TILE)
    wall(LEFT, 0, -1.75, 2.9)
    wall(-1.75, 0, -0.75, 0.95)
    wall(-1.75, 2.05, -0.75, 2.9)
    wall(-0.75, 0, 0.75, 2.9)
    wall(0.75, 2.1, 1.75, 2.9)
    wall(1.75, 0, RIGHT, 2.9)
    for x0, x1, y0, y1 in ((0.75, 1.75, 0, 2.1), (-1.75, -0.75, 0.95, 2.05)):  # their reveals
        back.quad((x0, y0, BACK), (0, 0, 0.25), (0, y1 - y0, 0), 0.25 / TILE, (y1 - y0) / TILE)
        back.quad((x1, y0, BACK + 0.25), (0, 0, -0.25), (0, y1 - y0, 0), 0.25 / TILE, (y1 - y0) / TILE)
        back.quad((x0, y1, BACK), (0, 0, 0.25), (x1 - x0, 0, 0), 0.25 / TILE, (x1 - x0) / TILE)
    right = Mesh()  # faces -x
    right.quad((RIGHT, 0, NEAR), (0, 0, BACK - NEAR), (0, 2.9, 0), (BACK - NEAR) / TILE, 2.9 / TILE)
    out["wall_back"], out["wall_right"] = back, right
    stone = Mesh()  # copings, sill, lintel, doorstep
    stone.box((LEFT - 0.1, 2.9, BACK - 0.06), (RIGHT + 0.3, 2.98, BACK + 0.3))
    stone.box((RIGHT - 0.06, 2.9, NEAR), (RIGHT + 0.3, 2.98, BACK - 0.06))
    stone.box((-1.85, 0.87, BACK - 0.10), (-0.65, 0.95, BACK + 0.3))
    stone.box((-1.87, 2.05, BACK - 0.03), (-0.63, 2.18, BACK + 0.1))
    stone.box((0.60, 2.1, BACK - 0.03), (1.90, 2.24, BACK + 0.1))
    stone.box((0.55, 0, BACK - 0.35), (1.95, 0.09, BACK + 0.2))
    stone.box((LEFT - 0.14, 0, NEAR), (LEFT + 0.14, 0.34, BACK))
    out["stone"] = stone
    pillar = Mesh()
    pillar.box((LEFT - 0.2, 0, BACK - 0.4), (LEFT + 0.2, 2.45, BACK), 1 / TILE)
    out["pillar"] = pillar
    caps = Mesh()
    caps.box((LEFT - 0.26, 2.45, BACK - 0.46), (LEFT + 0.26, 2.53, BACK + 0.02))
    out["pillar_cap"] = caps
    hedge = Mesh()  # hides where the ground ends
    hedge.box((-7.0, 0, NEAR), (-6.5, 1.05, 6.5))
    hedge.box((-6.5, 0, 6.0), (RIGHT, 1.05, 6.5))
    out["hedge"] = hedge
    door = Mesh()
    door.quad((0.75, 0, BACK + 0.2), (0, 2.1, 0), (1.0, 0, 0), 1.5, 1)
    out["door"] = door
    frame = Mesh()  # of the window: a cross and a border
    for x0, y0, x1, y1 in ((-1.75, 0.95, -1.69, 2.05), (-0.81, 0.95, -0.75, 2.05), (-1.69, 0.95, -0.81, 1.01),
                           (-1.69, 1.99, -0.81, 2.05), (-1.28, 1.01, -1.22, 1.99), (-1.69, 1.34, -1.27, 1.37),
                           (-1.23, 1.34, -0.81, 1.37), (-1.69, 1.66, -1.27, 1.69), (-1.23, 1.66, -0.81, 1.69)):
        frame.box((x0, y0, BACK + 0.10), (x1, y1, BACK + 0.15))
    out["window_frame"] = frame
    return out


# ---------------------------------------------------------------- the scene


MATERIALS = """# Textures and materials of the courtyard.

Texture "brick colour" "spectrum" "imagemap" "string filename" "textures/brick.png"
Texture "brick height" "float" "imagemap" "string filename" "textures/brick_height.png" "string encoding" "linear"
  "float scale" 0.012
Texture "paving colour" "spectrum" "imagemap" "string filename" "textures/paving.png"
  "float uscale" 5 "float vscale" 6.5 "string filter" "trilinear"
Texture "paving image" "float" "imagemap" "string filename" "textures/paving_height.png" "string encoding" "linear"
  "float uscale" 5 "float vscale" 6.5
Texture "paving height" "float" "scale" "texture tex" "paving image" "float scale" 0.016
Texture "wood colour" "spectrum" "imagemap" "string filename" "textures/wood.png"
Texture "dark wood" "spectrum" "scale" "texture tex" "wood colour" "float scale" 0.55
Texture "rust amount" "float" "imagemap" "string filename" "textures/rust.png" "string encoding" "linear"
  "float uscale" 2 "float vscale" 2
Texture "rust colour" "spectrum" "mix" "rgb tex1" [ 0.36 0.15 0.07 ] "rgb tex2" [ 0.20 0.09 0.05 ]
  "texture amount" "rust amount"
Texture "glaze" "spectrum" "imagemap" "string filename" "textures/stripes.png"
Texture "fence alpha" "float" "imagemap" "string filename" "textures/fence_alpha.png" "string encoding" "linear"
  "float uscale" 4
Texture "leaf colour" "spectrum" "imagemap" "string filename" "textures/leaf.png"
Texture "leaf alpha" "float" "imagemap" "string filename" "textures/leaf_alpha.png" "string encoding" "linear"
  "string wrap" "black"
Texture "ivy tint" "spectrum" "constant" "rgb value" [ 0.10 0.20 0.06 ]
Texture "ivy colour" "spectrum" "mix" "texture tex1" "ivy tint" "texture tex2" "leaf colour" "float amount" 0.35
Texture "ivy alpha" "float" "imagemap" "string filename" "textures/ivy_alpha.png" "string encoding" "linear"
  "string wrap" "black"

MakeNamedMaterial "brick" "string type" "diffuse" "texture reflectance" "brick colour"
  "texture displacement" "brick height"
MakeNamedMaterial "wet paving" "string type" "coateddiffuse" "texture reflectance" "paving colour"
  "float roughness" 0.07 "texture displacement" "paving height"
MakeNamedMaterial "stone" "string type" "diffuse" "rgb reflectance" [ 0.46 0.43 0.39 ]
MakeNamedMaterial "earth" "string type" "diffuse" "rgb reflectance" [ 0.05 0.07 0.03 ]
MakeNamedMaterial "varnished wood" "string type" "coateddiffuse" "texture reflectance" "wood colour"
  "float roughness" 0.02
MakeNamedMaterial "painted wood" "string type" "coateddiffuse" "texture reflectance" "dark wood" "float roughness" 0.2
MakeNamedMaterial "iron" "string type" "conductor" "rgb reflectance" [ 0.16 0.16 0.17 ] "float roughness" 0.25
MakeNamedMaterial "silver" "string type" "conductor" "spectrum eta" "metal-Ag-eta" "spectrum k" "metal-Ag-k"
  "float roughness" 0
MakeNamedMaterial "copper" "string type" "conductor" "spectrum eta" "metal-Cu-eta" "spectrum k" "metal-Cu-k"
  "float uroughness" 0.12 "float vroughness" 0.04
MakeNamedMaterial "lacquered gold" "string type" "coatedconductor" "spectrum conductor.eta" "metal-Au-eta"
  "spectrum conductor.k" "metal-Au-k" "float conductor.roughness" 0.12 "float interface.roughness" 0
MakeNamedMaterial "glass" "string type" "dielectric" "float eta" 1.5
MakeNamedMaterial "frosted glass" "string type" "dielectric" "float eta" 1.45 "float roughness" 0.04
MakeNamedMaterial "thin glass" "string type" "thindielectric" "float eta" 1.5
MakeNamedMaterial "glazed clay" "string type" "coateddiffuse" "texture reflectance" "glaze" "float roughness" 0
MakeNamedMaterial "orange" "string type" "coateddiffuse" "rgb reflectance" [ 0.85 0.33 0.05 ] "float roughness" 0.1
MakeNamedMaterial "apple" "string type" "coateddiffuse" "rgb reflectance" [ 0.55 0.06 0.05 ] "float roughness" 0.02
MakeNamedMaterial "plastic" "string type" "coateddiffuse" "rgb reflectance" [ 0.06 0.28 0.32 ] "float roughness" 0.005
MakeNamedMaterial "terracotta" "string type" "diffuse" "rgb reflectance" [ 0.55 0.24 0.13 ]
MakeNamedMaterial "rust" "string type" "diffuse" "texture reflectance" "rust colour"
MakeNamedMaterial "bronze" "string type" "conductor" "rgb reflectance" [ 0.62 0.42 0.20 ] "float roughness" 0.06
MakeNamedMaterial "rusty bronze" "string type" "mix" "string materials" [ "bronze" "rust" ]
  "texture amount" "rust amount"
MakeNamedMaterial "leaf" "string type" "coateddiffuse" "texture reflectance" "leaf colour" "float roughness" 0.3
MakeNamedMaterial "ivy" "string type" "diffuse" "texture reflectance" "ivy colour"
MakeNamedMaterial "cypress" "string type" "diffuse" "rgb reflectance" [ 0.025 0.05 0.025 ]
MakeNamedMaterial "paper" "string type" "diffuse" "rgb reflectance" [ 0.7 0.6 0.45 ]
"""


def shape(name, extra=""):
    return 'Shape "plymesh" "string filename" "meshes/%s.ply"%s\n' % (name, extra)


def placed(material, names, *transforms):
    lines = "AttributeBegin\n" + "".join("  %s\n" % t for t in transforms)
    lines += '  NamedMaterial "%s"\n' % material
    return lines + "".join("  " + shape(n) for n in names.split()) + "AttributeEnd\n"


def instance(name, *transforms):
    return "AttributeBegin %s ObjectInstance \"%s\" AttributeEnd\n" % (" ".join(transforms), name)


def translate(x, y, z):
    return "Translate %.4g %.4g %.4g" % (x, y, z)


def rotate_y(degrees):
    return "Rotate %.5g 0 1 0" % degrees


def scale(s):
    return "Scale %.4g %.4g %.4g" % (s, s, s)


def quad_text(p, uv, extra=""):
    points = " ".join("%g %g %g" % q for q in p)
    uvs = " ".join("%g %g" % t for t in uv)
    return 'Shape "trianglemesh" "point3 P" [ %s ]\n  "integer indices" [ 0 1 2 0 2 3 ] "point2 uv" [ %s ]%s\n' % (
        points, uvs, extra)


UNIT_UV = [(0, 0), (1, 0), (1, 1), (0, 1)]


def geometry():
    text = "# What stands in the courtyard.\n\n"
    text += 'NamedMaterial "wet paving"\n'
    far, right = BACK + 0.3, RIGHT + 0.1
    text += quad_text([(LEFT, 0, far), (right, 0, far), (right, 0, NEAR), (LEFT, 0, NEAR)], UNIT_UV)
    text += 'NamedMaterial "earth"\n'
    text += quad_text([(-7, -0.05, 6.5), (RIGHT, -0.05, 6.5), (RIGHT, -0.05, NEAR), (-7, -0.05, NEAR)], UNIT_UV)
    text += 'NamedMaterial "brick"\n' + shape("wall_back") + shape("wall_right") + shape("pillar")
    text += 'NamedMaterial "cypress"\n' + shape("hedge")
    text += 'NamedMaterial "stone"\n' + shape("stone") + shape("pillar_cap")
    text += 'NamedMaterial "painted wood"\n' + shape("door") + shape("window_frame")
    text += 'NamedMaterial "iron"\n'
    text += quad_text([(LEFT, 0.34, NEAR), (LEFT, 0.34, BACK - 0.4), (LEFT, 1.95, BACK - 0.4), (LEFT, 1.95, NEAR)],
                      UNIT_UV, ' "texture alpha" "fence alpha"')
    text += shape("cable")
    text += "\n# The table.\n"
    text += placed("varnished wood", "table_rim table_top")
    text += placed("iron", "table_foot")
    text += placed("copper", "bowl", translate(-0.24, 0.75, -0.02))
    text += placed("glass", "vase", translate(0.12, 0.75, 0.24))
    text += placed("silver", "ball", translate(0.02, 0.835, -0.29), scale(0.085))
    text += placed("glass", "ball", translate(-0.22, 0.815, -0.36), scale(0.065))
    text += placed("plastic", "ball", translate(0.20, 0.795, -0.40), scale(0.045))
    text += placed("frosted glass", "ball", translate(-0.42, 0.79, -0.22), scale(0.04))
    text += placed("glazed clay", "saucer cup cup_handle", translate(0.37, 0.75, -0.24), rotate_y(-35))
    text += placed("varnished wood", "bell_base", translate(0.33, 0.75, 0.06))
    text += placed("thin glass", "bell_jar", translate(0.33, 0.774, 0.06))
    text += placed("lacquered gold", "knot", translate(0.33, 0.774, 0.06))
    text += "\n# Around it.\n"
    text += placed("rusty bronze", "amphora", translate(-1.75, 0, 1.75))
    text += placed("terracotta", "pot", translate(1.5, 0, 1.3))
    text += placed("terracotta", "pot", translate(-1.3, 0, -0.1), scale(0.9))
    text += placed("terracotta", "pot", translate(0.2, 0.0, 2.4), scale(0.8))
    for x, z, turn in ((-0.75, 0.95, 20), (1.0, -0.3, 65)):
        text += placed("varnished wood", "stool_seat", translate(x, 0, z), rotate_y(turn))
        text += placed("iron", "stool_legs", translate(x, 0, z), rotate_y(turn))
    text += placed("iron", "lamp_shade lamp_arm", translate(1.25, 2.42, BACK - 0.28))
    return text


def instances():
    rng = random.Random(11)
    text = "# What stands there many times.\n\n"
    for name, material, mesh, alpha in (("plant", "leaf", "plant", "leaf alpha"), ("ivy", "ivy", "ivy", "ivy alpha"),
                                        ("orange", "orange", "fruit", ""), ("apple", "apple", "fruit", ""),
                                        ("cypress", "cypress", "cypress", "")):
        extra = ' "texture alpha" "%s"' % alpha if alpha else ""
        text += 'ObjectBegin "%s"\n  NamedMaterial "%s"\n  %sObjectEnd\n' % (name, material, shape(mesh, extra))
    text += "\n"
    text += instance("plant", translate(1.5, 0, 1.3))
    text += instance("plant", translate(-1.3, 0, -0.1), rotate_y(70), scale(0.9))
    text += instance("plant", translate(0.2, 0, 2.4), rotate_y(200), scale(0.8))
    text += instance("plant", translate(0.12, 0.93, 0.24), rotate_y(33), scale(0.55))
    fruits = [(0.0, 0.055, 0.0), (0.085, 0.07, 0.02), (-0.08, 0.07, 0.03), (0.02, 0.072, 0.088),
              (-0.015, 0.072, -0.088), (0.05, 0.125, -0.035), (-0.045, 0.125, 0.04),
              (0.035, 0.128, 0.052), (-0.05, 0.122, -0.045)]
    for k, (x, y, z) in enumerate(fruits):
        text += instance("apple" if k % 3 == 1 else "orange", translate(-0.24 + x, 0.75 + y, -0.02 + z),
                         "Rotate %d 1 0 0" % rng.randrange(-40, 40), rotate_y(rng.randrange(360)), scale(0.043))
    for x, z, s in ((-4.7, 3.6, 1.0), (-3.9, 5.2, 1.1), (-5.9, 1.8, 0.9), (-1.8, 5.9, 1.15), (1.6, 5.8, 1.1),
                    (-5.4, -0.6, 0.8)):
        text += instance("cypress", translate(x, 0, z), rotate_y(rng.randrange(360)), scale(s))
    for x, y in vine(rng, 150):
        text += instance("ivy", translate(x, y, BACK), "Rotate %d 0 0 1" % rng.randrange(360),
                         scale(rng.uniform(0.8, 1.3)))
    for z, y in vine(rng, 60):
        text += instance("ivy", translate(RIGHT, y, 1.2 + z * 0.5), rotate_y(90),
                         "Rotate %d 0 0 1" % rng.randrange(360), scale(rng.uniform(0.8, 1.2)))
    return text


def vine(rng, count):
    """Points below a wall's top, most of them at the left, in strands that hang down."""
    out = []
    while len(out) < count:
        x = -2.5 + 4.6 * rng.random() ** 1.3
        hang = 0.45 + 0.75 * max(0.0, math.sin(2.9 * x + 1.2))
        y = 2.85 - hang * rng.random() ** 1.3
        if not (-1.8 < x < -0.7 and y < 2.12):  # the window stays free
            out.append((x, y))
    return out


def scene():
    text = """# An evening courtyard: a demo of everything that the importer reads. Written by make_courtyard.py.

LookAt 0.5 1.36 -3  -0.05 0.99 0  0 1 0
Camera "perspective" "float fov" 35 "float lensradius" 0.012 "float focaldistance" 2.85
Film "rgb" "string filename" "courtyard.exr" "integer xresolution" 640 "integer yresolution" 360
PixelFilter "gaussian" "float xradius" 1.5 "float yradius" 1.5 "float sigma" 0.5
Sampler "sobol" "integer pixelsamples" 64
Integrator "path" "integer maxdepth" 8

WorldBegin

# Dusk, the moon through the fence, a lamp over the door, a small one behind the jar.
LightSource "infinite" "rgb L" [ 0.055 0.085 0.16 ]
LightSource "distant" "rgb L" [ 0.40 0.56 0.85 ] "point3 from" [ -6 4.6 -2.0 ] "point3 to" [ 0 0 0 ]
LightSource "spot" "rgb I" [ 11 7.6 4.2 ] "point3 from" [ 1.25 2.42 2.6 ] "point3 to" [ 1.22 0 2.45 ]
  "float coneangle" 52 "float conedeltaangle" 14
LightSource "point" "rgb I" [ 0.5 0.2 0.06 ] "point3 from" [ -2.2 0.55 2.3 ]

Include "materials.pbrt"
Include "geometry.pbrt"
Include "instances.pbrt"

# A shaded lamp over the spectator's head.
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 2.6 1.9 1.25 ]
  NamedMaterial "paper"
  Shape "trianglemesh" "point3 P" [ -0.4 2.6 -2.6  1.2 2.6 -2.6  1.2 2.9 -1.7  -0.4 2.9 -1.7 ]
    "integer indices" [ 0 1 2 0 2 3 ]
AttributeEnd

# The lit window.
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 1.5 0.85 0.34 ]
  NamedMaterial "paper"
"""
    z = BACK + 0.2
    text += "  " + quad_text([(-0.75, 0.95, z), (-1.75, 0.95, z), (-1.75, 2.05, z), (-0.75, 2.05, z)], UNIT_UV)
    text += "AttributeEnd\n\n# Paper lanterns on the cable.\n"
    for k, (t, colour) in enumerate(((0.19, (15, 7.5, 2.7)), (0.36, (14, 8, 3.2)), (0.53, (15, 7, 2.4)),
                                     (0.70, (14, 8.5, 3.6)))):
        p = cable_point(t)
        text += "AttributeBegin\n  " + translate(p[0], p[1] - 0.22, p[2]) + " " + scale(1.3)
        text += '\n  NamedMaterial "iron"\n  ' + shape("lantern_caps")
        text += '  NamedMaterial "paper"\n'
        text += '  AreaLightSource "diffuse" "rgb L" [ %g %g %g ] "float scale" 0.19\n' % colour
        text += "  " + shape("lantern") + "AttributeEnd\n"
    return text


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else os.path.join(os.path.dirname(os.path.abspath(__file__)), "courtyard")
    for name in ("meshes", "textures"):
        os.makedirs(os.path.join(folder, name), exist_ok=True)
    total = 0
    for name, mesh in meshes().items():
        mesh.write(os.path.join(folder, "meshes", name + ".ply"))
        total += len(mesh.triangles)
    textures = os.path.join(folder, "textures")
    for write in (brick_textures, paving_textures, wood_texture, rust_textures, fence_texture, leaf_textures):
        write(textures)
    for name, text in (("courtyard", scene()), ("materials", MATERIALS), ("geometry", geometry()),
                       ("instances", instances())):
        with open(os.path.join(folder, name + ".pbrt"), "w") as out:
            out.write(text)
    print("%d triangles in files" % total)


if __name__ == "__main__":
    main()
