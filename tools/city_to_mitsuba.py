#!/usr/bin/env python3
"""Converts the pbrt text that `spillway city --tessellate` writes into a scene of Mitsuba 3.

usage: tools/city_to_mitsuba.py CITY_FOLDER [-o scene.xml] [--spp N] [--resolution WxH] [--filter box] [--expand-instances]

Reads the directives that the generator writes, and no others. Differences: leaves reflect on both sides and let no light
through (Mitsuba 3 has no diffuse transmission); coats are its `plastic`, with internal reflections.
Variants on LLVM compile each instance (2,529 took more than four minutes and 11 GiB): --expand-instances makes meshes of them.
The sky is resampled from the equal-area octahedral image into latitude and longitude; this needs numpy and mitsuba.
"""
import argparse
import math
import os
import re
import sys

TOKEN = re.compile(r'"([^"]*)"|\[([^\]]*)\]|([^\s"\[\]]+)')


def directives(path, folder):
    """Yields (name, positional arguments, {parameter: value}) of the file and what it includes."""
    with open(path) as file:
        text = re.sub(r'^#.*$', '', file.read(), flags=re.M)
    current = None
    for match in TOKEN.finditer(text):
        string, listed, word = match.groups()
        if word is not None and re.match(r'[A-Z]', word):
            if current is not None:
                yield from finished(current, folder)
            current = [word]
        elif string is not None:
            current.append(('string', string))
        elif listed is not None:
            current.append(('list', listed.split()))
        else:
            current.append(('word', word))
    if current is not None:
        yield from finished(current, folder)


def finished(current, folder):
    name, arguments = current[0], current[1:]
    if name == 'Include':
        yield from directives(os.path.join(folder, arguments[0][1]), folder)
        return
    plain, parameters, index = [], {}, 0
    while index < len(arguments):
        kind, value = arguments[index]
        is_declaration = kind == 'string' and re.match(r'(rgb|float|integer|string|point3|bool) ', value)
        if not is_declaration:
            plain.append(value)
            index += 1
            continue
        given = arguments[index + 1][1]
        type_name, parameter = value.split()
        if type_name in ('rgb', 'point3', 'float', 'integer'):
            numbers = [float(x) for x in (given if isinstance(given, list) else [given])]
            given = numbers if type_name in ('rgb', 'point3') else numbers[0]
        parameters[parameter] = given
        index += 2
    yield name, plain, parameters


def rgb(name, value):
    return '<rgb name="%s" value="%s"/>' % (name, ', '.join('%.9g' % v for v in value))


def conductor_k(reflectance):
    """eta = 1 and the k that reflects so much at normal incidence, as pbrt does."""
    capped = [min(max(r, 0.0), 0.9999) for r in reflectance]
    return [2 * math.sqrt(r) / math.sqrt(1 - r) for r in capped]


def bsdf(name, p):
    alpha = math.sqrt(p.get('uroughness', 0))
    kind = p['type']
    if kind == 'conductor':
        inner = rgb('eta', [1, 1, 1]) + rgb('k', conductor_k(p['reflectance']))
        rough = '<string name="distribution" value="ggx"/><float name="alpha" value="%.9g"/>' % alpha
        body = '<bsdf type="roughconductor">%s%s</bsdf>' % (inner, rough) if alpha > 0 else '<bsdf type="conductor">%s</bsdf>' % inner
    elif kind == 'coateddiffuse':
        inner = rgb('diffuse_reflectance', p['reflectance']) + '<boolean name="nonlinear" value="true"/>'
        inner += '<float name="int_ior" value="%.9g"/><float name="ext_ior" value="1"/>' % p.get('eta', 1.5)
        rough = '<string name="distribution" value="ggx"/><float name="alpha" value="%.9g"/>' % alpha
        body = '<bsdf type="roughplastic">%s%s</bsdf>' % (inner, rough) if alpha > 0 else '<bsdf type="plastic">%s</bsdf>' % inner
    else:
        body = '<bsdf type="diffuse">%s</bsdf>' % rgb('reflectance', p['reflectance'])
    return '<bsdf type="twosided" id="%s">%s</bsdf>' % (name, body)


def equal_area_square(w):
    """Clarberg 2008; arrays of unit vectors to arrays of the unit square."""
    import numpy as np
    x, y, z = (np.abs(w[..., i]) for i in range(3))
    r = np.sqrt(np.maximum(0, 1 - z))
    phi = np.arctan2(np.minimum(x, y), np.maximum(x, y)) * 2 / np.pi
    phi = np.where(x < y, 1 - phi, phi)
    v, u = phi * r, r - phi * r
    below = w[..., 2] < 0
    u, v = np.where(below, 1 - v, u), np.where(below, 1 - u, v)
    return (np.copysign(u, w[..., 0]) + 1) / 2, (np.copysign(v, w[..., 1]) + 1) / 2


def convert_sky(source, target):
    import mitsuba as mi
    import numpy as np
    texels = np.array(mi.Bitmap(source).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32))
    height, width = 512, 1024
    theta = (np.arange(height) + 0.5) / height * np.pi
    phi = (np.arange(width) + 0.5) / width * 2 * np.pi
    theta, phi = np.meshgrid(theta, phi, indexing='ij')
    # Mitsuba's envmap has y up, and u = atan2(x, -z) / 2 pi; the scene turns it by 90 degrees about x.
    local = np.stack([np.sin(phi) * np.sin(theta), np.cos(theta), -np.cos(phi) * np.sin(theta)], axis=-1)
    world = np.stack([local[..., 0], -local[..., 2], local[..., 1]], axis=-1)
    u, v = equal_area_square(world)
    size = texels.shape[0]
    picked = texels[np.minimum((v * size).astype(int), size - 1), np.minimum((u * size).astype(int), size - 1)]
    mi.Bitmap(picked.astype(np.float32)).write(target)


class Converter:
    def __init__(self, folder, arguments):
        self.folder, self.arguments = folder, arguments
        self.head, self.body = [], []
        self.material, self.emission, self.transform, self.group = None, None, None, None
        self.objects, self.group_name = {}, None
        self.stack, self.film, self.fov, self.look_at, self.depth, self.spp = [], (1280, 720), 40, None, 5, 16

    # part: material, emission, file.
    def shape(self, part, transform=''):
        material, emission, file = part
        emitter = '<emitter type="area">%s</emitter>' % rgb('radiance', emission) if emission else ''
        name = os.path.abspath(os.path.join(self.folder, file))
        normals = b'property float nx' not in open(name, 'rb').read(512)
        return ('<shape type="ply"><string name="filename" value="%s"/><boolean name="face_normals" value="%s"/>'
                '<ref id="%s"/>%s%s</shape>') % (name, 'true' if normals else 'false', material, emitter, transform)

    # An object's name may be a material's too.
    def end_object(self):
        self.objects[self.group_name], self.group = self.group, None
        if not self.arguments.expand_instances:
            shapes = ''.join(self.shape(part) for part in self.objects[self.group_name])
            self.body.append('<shape type="shapegroup" id="object_%s">%s</shape>' % (self.group_name, shapes))

    def instance(self, name):
        transform = '<transform name="to_world"><matrix value="%s"/></transform>' % ' '.join('%.9g' % v for v in self.transform)
        if self.arguments.expand_instances:
            self.body.extend(self.shape(part, transform) for part in self.objects[name])
        else:
            self.body.append('<shape type="instance"><ref id="object_%s"/>%s</shape>' % (name, transform))

    def add(self, name, plain, p):
        if name == 'LookAt':
            self.look_at = [float(v) for v in plain]
        elif name == 'Camera':
            self.fov = p['fov']
        elif name == 'Film':
            self.film = (int(p['xresolution']), int(p['yresolution']))
        elif name == 'Sampler':
            self.spp = int(p['pixelsamples'])
        elif name == 'Integrator':
            self.depth = int(p['maxdepth'])
        elif name == 'MakeNamedMaterial':
            self.head.append(bsdf(plain[0], p))
        elif name == 'NamedMaterial':
            self.material = plain[0]
        elif name == 'AreaLightSource':
            self.emission = p['L']
        elif name == 'AttributeBegin':
            self.stack.append((self.material, self.emission, self.transform))
        elif name == 'AttributeEnd':
            self.material, self.emission, self.transform = self.stack.pop()
        elif name == 'Transform':
            columns = [float(v) for v in plain[0]]
            self.transform = [columns[4 * c + r] for r in range(4) for c in range(4)]
        elif name == 'ObjectBegin':
            self.group, self.group_name = [], plain[0]
        elif name == 'ObjectEnd':
            self.end_object()
        elif name == 'ObjectInstance':
            self.instance(plain[0])
        elif name == 'Shape' and plain[0] != 'plymesh':
            sys.exit('city_to_mitsuba: %s has shapes "%s": generate it with --tessellate' % (self.folder, plain[0]))
        elif name == 'Shape':
            part = self.material, self.emission, p['filename']
            if self.group is None:
                self.body.append(self.shape(part))
            else:
                self.group.append(part)
        elif name == 'LightSource':
            self.light(plain[0], p)
        elif name not in ('WorldBegin', 'Scale'):
            sys.exit('city_to_mitsuba: directive %s is none of the generator\'s' % name)

    def light(self, kind, p):
        if kind == 'distant':
            direction = ' '.join('%.9g' % -v for v in p['from'])
            self.body.append('<emitter type="directional"><vector name="direction" value="%s"/>%s</emitter>'
                             % (direction.replace(' ', ', '), rgb('irradiance', p['L'])))
            return
        sky = os.path.join(self.folder, 'sky_latlong.exr')
        convert_sky(os.path.join(self.folder, p['filename']), sky)
        self.body.append('<emitter type="envmap"><string name="filename" value="%s"/><transform name="to_world">'
                         '<rotate x="1" angle="90"/></transform></emitter>' % os.path.abspath(sky))

    def text(self):
        width, height = self.arguments.resolution or self.film
        view = ['%.9g, %.9g, %.9g' % tuple(self.look_at[3 * i:3 * i + 3]) for i in range(3)]
        sensor = ('<sensor type="perspective"><string name="fov_axis" value="smaller"/><float name="fov" value="%.9g"/>'
                  '<transform name="to_world"><lookat origin="%s" target="%s" up="%s"/></transform>'
                  '<sampler type="independent"><integer name="sample_count" value="%d"/></sampler>'
                  '<film type="hdrfilm"><integer name="width" value="%d"/><integer name="height" value="%d"/>'
                  '<rfilter type="%s"/></film></sensor>'
                  % (self.fov, view[0], view[1], view[2], self.arguments.spp or self.spp, width, height, self.arguments.filter))
        integrator = '<integrator type="path"><integer name="max_depth" value="%d"/></integrator>' % (self.depth + 1)
        return '\n'.join(['<scene version="3.0.0">', integrator, sensor] + self.head + self.body + ['</scene>', ''])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('folder')
    parser.add_argument('-o', '--output')
    parser.add_argument('--spp', type=int)
    parser.add_argument('--resolution', type=lambda text: tuple(int(v) for v in text.split('x')))
    parser.add_argument('--filter', choices=['gaussian', 'box'], default='gaussian')
    parser.add_argument('--expand-instances', action='store_true')
    arguments = parser.parse_args()
    import mitsuba as mi
    mi.set_variant('scalar_rgb')
    converter = Converter(arguments.folder, arguments)
    for name, plain, parameters in directives(os.path.join(arguments.folder, 'city.pbrt'), arguments.folder):
        converter.add(name, plain, parameters)
    with open(arguments.output or os.path.join(arguments.folder, 'city.xml'), 'w') as file:
        file.write(converter.text())


if __name__ == '__main__':
    main()
