"""Shading of surfaces on the device: textures, light from bodies that shine, and the shadows of spheres on spheres.

Only pictures with textures, shining bodies or shadows compile this code. All numbers are in single precision, whatever the
precision of the simulation.
"""

import math

import taichi as ti

from mpp_taichi.types import Template

LIMB_DARKENING = 0.6  # of a body that shines: I(μ)/I(1) = 1 − u (1 − μ), about the Sun's in visible light
HOT = 0.45  # share of white in the middle of a shining body
GLOW = 0.35  # of the air and the eye around a light: GLOW (radius/distance)³ …
GLOW_END = 1.5e-4  # … less half of the smallest displayed value, so that the glow ends
AMBIENT, DIFFUSE, SPECULAR = 0.12, 0.88, 0.18  # in scenes without a shining body


@ti.func
def single(number):
    """A literal in single precision; Taichi gives literals the precision of the simulation."""
    return ti.cast(number, ti.f32)


@ti.func
def direction(vector):
    """The vector at length one; not normalized(), whose default argument is in the simulation's precision."""
    return vector * (single(1) / ti.sqrt(vector.dot(vector)))


@ti.func
def highlight(normal, ray, light):
    """Blinn's highlight of exponent 32, seen along a ray.  [Blinn 1977, Comput. Graph. 11, 192]"""
    shine = ti.max(normal.dot(direction(light - direction(ray))), single(0.0))
    shine = shine * shine * shine * shine
    shine = shine * shine * shine * shine
    return shine * shine


@ti.func
def packed_light(drawing: Template, packed):
    """Light of red | green << 8 | blue << 16 as displayed."""
    return ti.Vector([drawing.levels[ti.cast(packed >> 8 * channel & 255, ti.i32)] for channel in ti.static(range(3))])


@ti.func
def texel_light(drawing: Template, k):
    """Light of one texel."""
    return packed_light(drawing, drawing.texels[k])


@ti.func
def texture_light(drawing: Template, m, normal):
    """Light of the texture of material m where the surface has a normal, between the four nearest texels."""
    material, place = ti.static(drawing.material, drawing.place)
    first, width, height = place[m, 0], place[m, 1], place[m, 2]
    east = normal.dot(ti.Vector([material[m, 0], material[m, 1], material[m, 2]]))
    north_east = normal.dot(ti.Vector([material[m, 3], material[m, 4], material[m, 5]]))
    north = normal.dot(ti.Vector([material[m, 6], material[m, 7], material[m, 8]]))
    north = ti.min(ti.max(north, single(-1.0)), single(1.0))
    u = (ti.atan2(north_east, east) * single(0.5 / math.pi) + single(0.5)) * width - single(0.5)
    v = ti.acos(north) * single(1.0 / math.pi) * height - single(0.5)
    v = ti.min(ti.max(v, single(0.0)), ti.cast(height - 1, ti.f32))
    column, row = ti.cast(ti.floor(u), ti.i32), ti.cast(ti.floor(v), ti.i32)
    s, t = u - ti.floor(u), v - ti.floor(v)
    left, right = (column + width) % width, (column + 1 + width) % width
    upper, lower = first + row * width, first + ti.min(row + 1, height - 1) * width
    above = texel_light(drawing, upper + left) * (1 - s) + texel_light(drawing, upper + right) * s
    below = texel_light(drawing, lower + left) * (1 - s) + texel_light(drawing, lower + right) * s
    return above * (1 - t) + below * t


@ti.func
def covered_share(a, b, c):
    """Share of a disk of radius a that a disk of radius b covers, with their middles at the distance c."""
    share = single(0.0)
    if c < a + b:
        if c <= ti.abs(a - b):
            share = ti.min(single(1.0), b * b / (a * a))
        else:
            # Two circular segments of the lens in which circles meet, by the cosines of half their angles.
            at_a = ti.min(ti.max((c * c + a * a - b * b) / (2 * c * a), single(-1.0)), single(1.0))
            at_b = ti.min(ti.max((c * c + b * b - a * a) / (2 * c * b), single(-1.0)), single(1.0))
            kite = ti.max((a + b - c) * (c + a - b) * (c - a + b) * (a + b + c), single(0.0))
            lens = a * a * ti.acos(at_a) + b * b * ti.acos(at_b) - single(0.5) * ti.sqrt(kite)
            share = ti.min(lens / (single(math.pi) * a * a), single(1.0))
    return share


@ti.func
def seen_share(drawing: Template, point, to_light, distance, light_radius, index):
    """Share of a light's disk that is visible from a point of particle `index`, past all casters of shadows between them.

    Disks are compared in the plane at unit distance from the point; where casters overlap, their shares are multiplied.
    """
    casters = ti.static(drawing.casters)
    share, disk = single(1.0), light_radius / distance
    for k in range(drawing.caster_count):
        if casters[k, 4] != index:
            way = ti.Vector([casters[k, 0], casters[k, 1], casters[k, 2]]) - point
            along = way.dot(to_light)
            if along > 0 and along < distance:
                aside = way - along * to_light
                reach = casters[k, 3] + along * disk  # of the half shadow, at the distance of the caster from the point
                if aside.dot(aside) < reach * reach:
                    share *= 1 - covered_share(disk, casters[k, 3] / along, ti.sqrt(aside.dot(aside)) / along)
    return share


@ti.func
def surface_at(drawing: Template, p, x, y, depth):
    """The ray through (x, y), the point at a depth where it meets sphere p, and the normal of the sphere there."""
    table = ti.static(drawing.table)
    ray = ti.Vector([x, y, single(1.0)])
    point = ray * depth
    if drawing.orthographic == 1:
        ray = ti.Vector([single(0.0), single(0.0), single(1.0)])
        point = ti.Vector([x, y, depth])
    return ray, point, (point - ti.Vector([table[p, 5], table[p, 6], table[p, 7]])) * (single(1) / table[p, 8])


@ti.func
def shade_plain(drawing: Template, p, x, y, depth):
    """Light that reaches the eye from sphere p: ambient, diffuse and a highlight, from a distant light."""
    albedo = ti.Vector([drawing.table[p, k] for k in ti.static(range(9, 12))])
    ray, _, normal = surface_at(drawing, p, x, y, depth)
    return lit_from_afar(drawing, albedo, normal, ray, single(SPECULAR))


@ti.func
def lit_from_afar(drawing: Template, albedo, normal, ray, specular):
    """Light from a surface in a scene without a shining body."""
    diffuse = ti.max(normal.dot(drawing.light), single(0.0))
    return albedo * (single(AMBIENT) + single(DIFFUSE) * diffuse) + specular * highlight(normal, ray, drawing.light)


@ti.func
def shade_surface(drawing: Template, p, x, y, depth):
    """Light that reaches the eye from sphere p: from shining bodies, or from a distant light in a scene without them."""
    lights, material = ti.static(drawing.lights, drawing.material)
    color = ti.Vector([drawing.table[p, k] for k in ti.static(range(9, 12))])
    ray, point, normal = surface_at(drawing, p, x, y, depth)
    m = ti.cast(drawing.table[p, 12], ti.i32)
    shines, specular = single(0.0), single(SPECULAR)
    if m >= 0:
        shines = material[m, 9]
        if drawing.place[m, 1] > 0:
            color = texture_light(drawing, m, normal)
            specular = single(0.0)
    if shines > 0:
        toward_eye = ti.max(-normal.dot(direction(ray)), single(0.0))
        white = single(HOT) * toward_eye * toward_eye  # as a film shows light that is too bright for it
        color = (color + white * (1 - color)) * (1 - single(LIMB_DARKENING) * (1 - toward_eye))
    elif drawing.light_count == 0:
        color = lit_from_afar(drawing, color, normal, ray, specular)
    else:
        albedo = color
        color = albedo * drawing.ambient
        for k in range(drawing.light_count):
            way = ti.Vector([lights[k, 0], lights[k, 1], lights[k, 2]]) - point
            distance = ti.sqrt(way.dot(way))
            to_light = way * (single(1) / distance)
            diffuse = normal.dot(to_light)
            if diffuse > 0:
                light = albedo * diffuse
                if specular > 0:
                    light += specular * highlight(normal, ray, to_light)
                color += light * seen_share(drawing, point, to_light, distance, lights[k, 3], drawing.table[p, 13])
    return color


@ti.func
def glow(drawing: Template, x, y, depth):
    """The glow around shining bodies, which are the first lights of the table, in front of everything behind them."""
    lights = ti.static(drawing.lights)
    total = ti.Vector([single(0.0), single(0.0), single(0.0)])
    for k in range(drawing.glow_count):
        mx, my, mz, size2 = lights[k, 0], lights[k, 1], lights[k, 2], lights[k, 3] * lights[k, 3]
        aside = (mx - x) * (mx - x) + (my - y) * (my - y)
        near = mz
        if drawing.orthographic == 0:
            near = (mx * x + my * y + mz) / (x * x + y * y + 1)
            ox, oy, oz = mx - near * x, my - near * y, mz - near
            aside = ox * ox + oy * oy + oz * oz
        if near > 0 and depth > near and aside > size2:
            share = size2 / aside
            strength = single(GLOW) * share * ti.sqrt(share) - single(GLOW_END)
            total += ti.max(strength, single(0.0)) * ti.Vector([lights[k, 4], lights[k, 5], lights[k, 6]])
    return total
