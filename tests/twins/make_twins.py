#!/usr/bin/env python3
"""Renders the scenes of this folder with Mitsuba 3, into tests/images: what the pictures of Spillway are held against.

  pip install mitsuba numpy OpenEXR
  tests/twins/make_twins.py [NAME...] [--samples N]

Each scene is written twice, by hand: as NAME.pbrt for Spillway, and below for Mitsuba. The images hold the mean over all
seeds and those of two halves of them, from which the test takes the variance (tools/metrics/statistical_equality.h).

A picture is noisy everywhere: no pixel sees the sky, whose sum in 32 bits Mitsuba would round.
Where the two models differ there is no twin: rough GGX surfaces (Mitsuba's Smith term is separable, Spillway's is
height-correlated), soft edges of spots (linear in the angle against a smoothstep in the cosine; the spot here has none), masks (the
shadows of Mitsuba's path integrator are lighter than the opacity says), blends (the two densities of Mitsuba's blend do
not agree, so that its weights do not sum to one): tests/tools/twins_test.cpp has exact answers. It has no goniometric light
and no sheet that transmits diffusely either: exact answers are there and in tests/failures.
Where Mitsuba interpolates something else (albedo instead of scattering, environments between texels, projected images by
the irradiance of a plane), it gets the same function sampled many times finer, written here a second time.
Mitsuba has no motion: a scene that moves is a function of time, rendered at 512 times for each half, one in each of as
many equal parts of the time that the shutter is open.
Mitsuba's images have their first row at v = 0, pbrt's at v = 1: the texture is turned over.
"""

import argparse
import math
import pathlib
import re
import struct
import zlib

import mitsuba as mi
import numpy as np
import OpenEXR

mi.set_variant("scalar_rgb")
T = mi.ScalarTransform4f
FOLDER = pathlib.Path(__file__).resolve().parent
WIDTH, HEIGHT, SEEDS = 48, 32, 16
# Images, no two texels alike.
STRIPES = [[(20 + 60 * x, 230 - 70 * y, 40 + 50 * ((x + 2 * y) % 4)) for x in range(4)] for y in range(3)]
PATCHES = [[(15 + 12 * x, 20 + 11 * y, 17 + 13 * ((3 * x + 5 * y) % 8)) for x in range(8)] for y in range(8)]
PATCHES[2][5] = (255, 240, 200)
VIEW = T().look_at([0, -4, 6], [0, 0, 0.4], [0, 0, 1])


def rgb(*values):
    return {"type": "rgb", "value": list(values)}


def diffuse(*values):
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(*values)}}


def sensor(kind="perspective", to_world=VIEW, **more):
    film = {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}, "pixel_format": "rgb",
            "component_format": "float32"}
    if kind != "orthographic":
        more = {"fov": 32, "fov_axis": "smaller", **more}
    return {"type": kind, "to_world": to_world, "film": film, **more}


def cube(to_world, bsdf):
    return {"type": "cube", "to_world": to_world, "bsdf": bsdf}


def rectangle(to_world, **more):
    return {"type": "rectangle", "to_world": to_world, **more}


FLOOR = rectangle(T().scale([8, 8, 1]), bsdf=diffuse(0.5, 0.4, 0.3))
BLACK = diffuse(0, 0, 0)
# Turned to look down.
PANEL = rectangle(T().translate([1, -1, 4]) @ T().rotate([1, 0, 0], 180), bsdf=BLACK,
                  emitter={"type": "area", "radiance": rgb(9, 8, 7)})
SKY = {"type": "constant", "radiance": rgb(0.5, 0.6, 0.7)}
BLOCK = T().translate([0, 0, 0.8]) @ T().rotate([0, 0, 1], 30) @ T().scale([0.8, 0.6, 0.8])
GREY = diffuse(0.6, 0.6, 0.6)
BLUE = diffuse(0.2, 0.5, 0.7)


WALL = rectangle(T().translate([-2, 1, 2]) @ T().rotate([0, 1, 0], 90) @ T().scale([2, 3, 1]), bsdf=diffuse(0.7, 0.1, 0.1))


def block_of(bsdf, **more):
    return {"floor": FLOOR, "panel": PANEL, "block": cube(BLOCK, bsdf), "sensor": sensor(), **more}


def lamp(name, to_world):
    """A panel that looks down and a block beside it, both moved: what an object with an emitter is in each instance."""
    panel = to_world @ T().translate([0.6, 0, 3]) @ T().rotate([1, 0, 0], 180) @ T().scale([0.8, 0.5, 1])
    return {name + "_panel": rectangle(panel, bsdf=BLACK, emitter={"type": "area", "radiance": rgb(9, 8, 7)}),
            name + "_block": cube(to_world @ T().translate([-0.3, 0.2, 0.5]) @ T().scale([0.4, 0.2, 0.4]), BLUE)}


def motion(time):
    """What moves does so from time 0 to 1, and stands where it arrived afterwards."""
    t = min(time, 1)

    def between(a, b):
        return [(1 - t) * x + t * y for x, y in zip(a, b)]

    def placed(start, end, axis, angle, scale_start, scale_end):
        return {"type": "instance", "group": {"type": "ref", "id": "group"}, "to_world":
                T().translate(between(start, end)) @ T().rotate(axis, t * angle) @ T().scale(between(scale_start, scale_end))}

    return {"floor": FLOOR, "panel": PANEL, "sky": SKY,
            "sensor": sensor(to_world=T().translate([-0.4 * t, -0.2 * t, 0]) @ VIEW),
            "group": {"type": "shapegroup", "cube": {"type": "cube", "bsdf": BLUE}},
            "first": placed([-1, 0, 0.5], [-0.6, 0.5, 0.9], [0, 0, 1], 110, [0.5, 0.3, 0.5], [0.5, 0.5, 0.3]),
            "second": placed([0.8, 0.4, 0.9], [0.8, -0.2, 1.1], [0.5**0.5, 0.5**0.5, 0], -70, [-0.6, 0.5, 0.4],
                             [-0.4, 0.5, 0.4])}


SHUTTER, TIMES = {"motion": (0.2, 1.2)}, 512
SCENES = {
    "motion": motion,
    "box": block_of(GREY, wall=WALL),
    "mirror": block_of({"type": "conductor", "eta": rgb(0.2, 0.9, 1.1), "k": rgb(3.9, 2.5, 2.4)}),
    # Raised from the floor: where two surfaces coincide, the order in which they are met is nobody's.
    "glass": {"floor": FLOOR, "panel": PANEL, "sky": SKY, "sensor": sensor(),
              "block": cube(T().translate([0, 0, 0.2]) @ BLOCK, {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0})},
    "thin_glass": {"floor": FLOOR, "panel": PANEL, "sky": SKY, "sensor": sensor(), "pane": rectangle(
        T().translate([0, -0.35, 1]) @ T(np.array([[1.5, 0, 0, 0], [0, 0.15, -0.9, 0], [0, 0.9, 0.15, 0], [0, 0, 0, 1.0]])),
        bsdf={"type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0})},
    "bulb_point": {"floor": FLOOR, "block": cube(BLOCK, GREY), "sensor": sensor(),
                   "light": {"type": "point", "position": [-1, -2, 3], "intensity": rgb(10, 9, 8)}},
    "spot": {"floor": FLOOR, "block": cube(BLOCK, GREY), "sensor": sensor(),
             "light": {"type": "spot", "to_world": T().look_at([-1, -2, 4], [0.3, 0.2, 0], [0, 0, 1]), "cutoff_angle": 20,
                       "beam_width": 19.9999, "intensity": rgb(30, 30, 24)}},
    "sun": {"floor": FLOOR, "wall": WALL, "block": cube(BLOCK, GREY), "sensor": sensor(),
            "light": {"type": "directional", "direction": [-1, 2, -3], "irradiance": rgb(2, 1.8, 1.5)}},
    "sky": {"floor": FLOOR, "block": cube(BLOCK, GREY), "sensor": sensor(), "sky": SKY},
    "instances": {
        "floor": FLOOR, "panel": PANEL, "sky": SKY, "sensor": sensor(),
        "group": {"type": "shapegroup", "cube": {"type": "cube", "bsdf": BLUE}},
        "first": {"type": "instance", "group": {"type": "ref", "id": "group"}, "to_world":
                  T().translate([-1, 0, 0.5]) @ T().rotate([0, 0, 1], 20) @ T().scale([0.5, 0.3, 0.5])},
        "second": {"type": "instance", "group": {"type": "ref", "id": "group"}, "to_world":
                   T().translate([0.8, 0.4, 0.9]) @ T().rotate([0.5**0.5, 0.5**0.5, 0], -35) @ T().scale([-0.6, 0.5, 0.4])}},
    "lens": {**block_of(GREY, sky=SKY), "sensor": sensor("thinlens", aperture_radius=0.25, focus_distance=4.0)},
    "bulb": {"floor": FLOOR, "sensor": sensor(),
             "bulb": {"type": "sphere", "center": [0.5, -0.5, 1.5], "radius": 0.4, "bsdf": BLACK,
                      "emitter": {"type": "area", "radiance": rgb(12, 11, 10)}},
             "cube": cube(T().translate([-1.2, 0, 0.5]) @ T().scale(0.5), GREY)},
    "plastic": block_of({"type": "plastic", "diffuse_reflectance": rgb(0.7, 0.3, 0.1), "int_ior": 1.5, "ext_ior": 1.0,
                         "nonlinear": True}, sky=SKY),
    "orthographic": {**block_of(GREY, sky=SKY), "sensor": sensor("orthographic", VIEW @ T().scale([3, 3, 1]))},
    "texture": {"panel": PANEL, "sky": SKY, "sensor": sensor(), "floor": rectangle(T().scale([8, 8, 1]), bsdf={
        "type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {
            "type": "bitmap", "filename": str(FOLDER / "stripes.png"), "filter_type": "nearest",
            "to_uv": T().scale([8, -4, 1])}}})},
    # pbrt's spherical mapping runs from pole to pole in s and around in t; Mitsuba's spheres have u around and v down.
    "globe": {"floor": FLOOR, "panel": PANEL, "sky": SKY, "sensor": sensor(), "globe": {
        "type": "sphere", "center": [0, 0, 1.2], "radius": 1, "bsdf": {"type": "twosided", "bsdf": {
            "type": "diffuse", "reflectance": {
                "type": "bitmap", "filename": str(FOLDER / "stripes.png"), "filter_type": "nearest",
                "to_uv": T(np.array([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))}}}}},
    "quadrics": {
        "floor": FLOOR, "sky": SKY, "sensor": sensor(),
        "lamp": {"type": "disk", "to_world": T().translate([0.5, -0.5, 3.5]) @ T().rotate([1, 0, 0], 180) @ T().scale(0.7),
                 "bsdf": BLACK, "emitter": {"type": "area", "radiance": rgb(12, 11, 10)}},
        "tube": {"type": "cylinder", "p0": [0, 0, 0.4], "p1": [0, 0, 1.6], "radius": 0.6, "bsdf": GREY,
                 "to_world": T().translate([-0.8, 0.4, 0]) @ T().rotate([0, 1, 0], 20)},
        "plate": {"type": "disk", "bsdf": BLUE, "to_world":
                  T().translate([1, 0.3, 0.7]) @ T().rotate([0.5**0.5, 0.5**0.5, 0], -40) @ T().scale(0.8)}},
    "lamps": {"floor": FLOOR, "sensor": sensor(), **lamp("first", T().translate([0.9, 0, 0])),
              **lamp("second", T().translate([-1, -0.5, 0.2]) @ T().rotate([0, 1, 0], 15) @ T().scale([-1, 1, 0.8]))},
}


# ---- lights in number, and media ----

def text_of(name):
    return (FOLDER / f"{name}.pbrt").read_text()


def many_lamps():
    """Forty rows of 25: instances in the other text, panels here, where each is found in the object's meshes."""
    scene = {"floor": FLOOR, "block": cube(BLOCK, GREY), "sensor": sensor()}
    text = text_of("many_lamps")
    meshes = re.findall(r'"rgb L" \[([^]]*)\]\nShape "trianglemesh" "point3 P" \[([^]]*)\]', text)
    rows = re.findall(r"Translate ([^O]*) ObjectInstance", text)
    for i, row in enumerate(rows):
        for j, (radiance, points) in enumerate(meshes):
            corners = np.array(points.split(), dtype=float).reshape(-1, 4, 3)
            for k, center in enumerate(corners.mean(axis=1)):
                half = np.abs(corners[k] - center).max(axis=0)
                scene[f"lamp_{i}_{j}_{k}"] = rectangle(
                    T().translate(list(np.array(row.split(), dtype=float) + center)) @ T().rotate([1, 0, 0], 180) @
                    T().scale([half[0], half[1], 1]), bsdf=BLACK,
                    emitter={"type": "area", "radiance": rgb(*map(float, radiance.split()))})
    return scene


def gas(name):
    """The medium of a uniform grid, from the other text; its outermost cells are empty, where the two models differ."""
    text = text_of(name)

    def numbers(parameter):
        return np.array(re.search(rf'"{parameter}" \[?([^]"\n]*(?:\n[^]"]*)?)', text).group(1).split(), dtype=float)

    scattered, absorbed = numbers("rgb sigma_s"), numbers("rgb sigma_a")
    density = numbers("float density").reshape(6, 6, 6, 1)
    lower, upper = numbers("point3 p0"), numbers("point3 p1")
    extinction = (scattered + absorbed) / max(scattered + absorbed)
    return {"type": "heterogeneous", "scale": max(scattered + absorbed),
            "albedo": {"type": "constvolume", "value": rgb(*(scattered / (scattered + absorbed)))},
            "phase": {"type": "hg", "g": numbers("float g")[0]},
            "sigma_t": {"type": "gridvolume", "grid": mi.VolumeGrid((density * extinction).astype(np.float32)), "raw": True,
                        "to_world": T().translate(list(lower)) @ T().scale(list(upper - lower))}}


NOTHING = {"type": "null"}


def texels_of(rows):
    """Linear values of 8-bit sRGB ones."""
    encoded = np.array(rows, dtype=float) / 255
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055)**2.4)


def bitmap(texels, **more):
    return {"type": "bitmap", "bitmap": mi.Bitmap(texels.astype(np.float32)), "raw": True, **more}


def projector():
    """Its intensity is constant over a texel: on Mitsuba's plane at distance 1 the irradiance falls with the cubed cosine."""
    fine, tangent = 32, math.tan(math.radians(20))
    texels = texels_of(STRIPES).repeat(fine, axis=0).repeat(fine, axis=1)
    height, width, _ = texels.shape
    y, x = np.mgrid[0:height, 0:width] + 0.5
    x, y = (2 * x / width - 1) * tangent * width / height, (2 * y / height - 1) * tangent
    cosine = 1 / np.sqrt(1 + x**2 + y**2)
    return {"type": "projector", "fov": 40, "fov_axis": "y", "scale": 60 / math.pi,
            "to_world": T().look_at([-1, -2, 4], [0.3, 0.2, 0], [0, 0, 1]),
            "irradiance": bitmap((texels * cosine[:, :, None]**3)[:, ::-1], filter_type="nearest")}  # x is to the left


def octahedral_square(x, y, z):
    """Where directions lie in an equal-area image (Clarberg 2008), by its definition: the areas are those of caps."""
    around = np.arctan2(np.minimum(abs(x), abs(y)), np.maximum(abs(x), abs(y))) * 2 / math.pi  # of an eighth turn: 1/2
    radius = np.sqrt(1 - abs(z))
    near, far = radius * (1 - around), radius * around  # along the axis that is nearer, and across
    u, v = np.where(abs(x) >= abs(y), near, far), np.where(abs(x) >= abs(y), far, near)
    u, v = np.where(z < 0, 1 - v, u), np.where(z < 0, 1 - u, v)
    return (np.copysign(u, x) + 1) / 2, (np.copysign(v, y) + 1) / 2


def patches():
    width, height = 2048, 1025
    j, i = np.mgrid[0:height, 0:width]
    phi, theta = 2 * math.pi * (i + 0.5) / width, math.pi * j / (height - 1)
    square = octahedral_square(np.sin(phi) * np.sin(theta), np.cos(theta), -np.cos(phi) * np.sin(theta))
    column, row = (np.minimum((8 * s).astype(int), 7) for s in square)
    return {"type": "envmap", "bitmap": mi.Bitmap(texels_of(PATCHES)[row, column].astype(np.float32)), "scale": 5,
            "to_world": T().rotate([0, 0, 1], 25) @ T().rotate([1, 0, 0], 40)}


def screen():
    """Upright, its picture towards +x."""
    place = T().translate([-1.6, 0.2, 1]) @ T().rotate([0, 0, 1], 90) @ T().rotate([1, 0, 0], 90) @ T().scale([1.2, 0.9, 1])
    return rectangle(place, bsdf=GREY, emitter={
        "type": "area", "radiance": bitmap(8 * texels_of(STRIPES)[::-1], filter_type="bilinear", wrap_mode="clamp")})


def finer(grid, times):
    """The trilinear function between samples in the middles of cells, at the middles of finer ones."""
    for axis in range(3):
        count = grid.shape[axis]
        at = np.clip((np.arange(count * times) + 0.5) / times - 0.5, 0, count - 1)
        low = np.minimum(at.astype(int), count - 2)
        part = (at - low).reshape([-1 if a == axis else 1 for a in range(4)])
        grid = grid.take(low, axis) * (1 - part) + grid.take(low + 1, axis) * part
    return grid


def colors():
    text = text_of("colors")

    def samples(parameter):
        values = re.search(rf'"rgb {parameter}" \[([^]]*)\]', text).group(1).split()
        return 1.5 * np.array(values, dtype=float).reshape(6, 6, 6, 3)

    scattered = finer(samples("sigma_s"), 8)
    extinction = scattered + finer(samples("sigma_a"), 8)
    albedo = np.divide(scattered, extinction, out=np.zeros_like(scattered), where=extinction > 0)
    for axis in range(3):  # what is next to nothing is not blended with black
        for side in (1, -1):
            albedo = np.where(extinction > 0, albedo, np.maximum(albedo, np.roll(albedo, side, axis)))
    place = T().translate([-1.2, -1.2, 0.1]) @ T().scale(2.4)

    def volume(values):
        return {"type": "gridvolume", "grid": mi.VolumeGrid(values.astype(np.float32)), "raw": True, "to_world": place}

    return {"type": "heterogeneous", "albedo": volume(albedo), "sigma_t": volume(extinction),
            "phase": {"type": "hg", "g": 0.2}}


def homogeneous(absorbed, scattered, g):
    total = [a + s for a, s in zip(absorbed, scattered)]
    return {"type": "homogeneous", "scale": 4, "sigma_t": rgb(*(t / 4 for t in total)), "albedo": rgb(*(s / t for s, t in zip(scattered, total))),
            "phase": {"type": "hg", "g": g}}


FOG = {"type": "ref", "id": "fog_medium"}
SCENES |= {
    "many_lamps": many_lamps(),
    "projector": {"floor": FLOOR, "block": cube(BLOCK, GREY), "sensor": sensor(), "light": projector()},
    "screen": {"floor": FLOOR, "block": cube(BLOCK, GREY), "sensor": sensor(), "screen": screen()},
    "patches": {"floor": FLOOR, "block": cube(BLOCK, GREY), "sensor": sensor(), "sky": patches()},
    "fog": {"floor": FLOOR, "panel": PANEL, "sensor": sensor(),
            "bulb": {"type": "sphere", "center": [-0.8, -0.3, 1.2], "radius": 0.25, "bsdf": BLACK,
                     "emitter": {"type": "area", "radiance": rgb(6, 9, 12)}},
            "fog": {**cube(T().translate([0, 0, 1.05]) @ T().scale([2.5, 2, 1]), NOTHING), "interior": {
                "type": "homogeneous", "sigma_t": rgb(0.42, 0.33, 0.25), "phase": {"type": "hg", "g": 0.4},
                "albedo": rgb(0.4 / 0.42, 0.3 / 0.33, 0.2 / 0.25)}},
            "block": cube(T().translate([0.6, 0.3, 0.5]) @ T().rotate([0, 0, 1], 30) @ T().scale([0.4, 0.4, 0.4]), GREY)},
    "smoke": {"floor": FLOOR, "panel": PANEL, "sensor": sensor(),
              "smoke": {**cube(T().translate([0, 0, 1.3]) @ T().scale([1.2, 1.2, 1.2]), NOTHING), "interior": gas("smoke")}},
    "cloud_in_glass": {"floor": FLOOR, "sky": SKY, "sensor": sensor(),
                       "ball": {"type": "sphere", "center": [0, 0, 1.3], "radius": 1, "interior": gas("cloud_in_glass"),
                                "bsdf": {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}}},
}
SCENES |= {
    "colors": {"floor": FLOOR, "panel": PANEL, "sensor": sensor(),
               "cloud": {**cube(T().translate([0, 0, 1.3]) @ T().scale(1.2), NOTHING), "interior": colors()}},
    "nested": {"fog_medium": homogeneous([0.002, 0.004, 0.008], [0.05, 0.04, 0.03], 0.3), "floor": FLOOR, "panel": PANEL,
               "sensor": {**sensor(), "medium": FOG},
               "fog": {**cube(T().translate([0, 0, 8.999]) @ T().scale([7.9, 7.9, 9]), NOTHING), "interior": FOG},
               "ball": {"type": "sphere", "center": [-0.5, 0, 1.2], "radius": 0.9, "bsdf": NOTHING, "exterior": FOG,
                        "interior": homogeneous([0.3, 0.1, 0.02], [1, 1.5, 2], -0.2)},
               "block": cube(T().translate([1.2, 0.4, 0.5]) @ T().rotate([0, 0, 1], 30) @ T().scale(0.4), GREY)},
}
WITH_MEDIA = {"fog", "smoke", "cloud_in_glass", "colors", "nested"}


def write_png(path, rows):
    """8-bit sRGB."""
    height, width = len(rows), len(rows[0])
    raw = b"".join(b"\0" + bytes(v for texel in row for v in texel) for row in rows)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))


def write_picture(path, halves, samples):
    channels = {}
    for prefix, image in (("", (halves[0] + halves[1]) / 2), ("halfA.", halves[0]), ("halfB.", halves[1])):
        for i, name in enumerate("RGB"):
            channels[prefix + name] = np.ascontiguousarray(image[:, :, i], dtype=np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage,
              "spillway:half_a_spp": samples // 2, "spillway:half_b_spp": samples // 2}
    OpenEXR.File(header, channels).write(str(path))


def image_of(scene, samples, seed, integrator="path"):
    scene = mi.load_dict({"type": "scene", "integrator": {"type": integrator, "max_depth": 65}, **scene})
    return np.array(mi.render(scene, spp=samples, seed=seed), dtype=np.float64)


def moving_half(name, half, samples):
    """The mean over as many samples, at a random time in each part of the shutter's."""
    random = np.random.default_rng(half)
    opens, closes = SHUTTER[name]
    return np.mean([image_of(SCENES[name](opens + (closes - opens) * (i + random.random()) / TIMES), samples // TIMES,
                             half * TIMES + i) for i in range(TIMES)], axis=0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=[])
    parser.add_argument("--samples", type=int, default=8192)
    arguments = parser.parse_args()
    write_png(FOLDER / "stripes.png", STRIPES)
    write_png(FOLDER / "patches.png", PATCHES)
    for name in arguments.names or SCENES:
        if name in SHUTTER:
            halves = [moving_half(name, half, arguments.samples // 2) for half in (0, 1)]
        else:
            integrator = "volpath" if name in WITH_MEDIA else "path"
            images = [image_of(SCENES[name], arguments.samples // SEEDS, seed, integrator) for seed in range(SEEDS)]
            halves = [np.mean(images[::2], axis=0), np.mean(images[1::2], axis=0)]
        write_picture(FOLDER.parent / "images" / f"{name}.exr", halves, arguments.samples)
        print(f"{name}: mean {np.mean(halves):.6f}")


if __name__ == "__main__":
    main()
