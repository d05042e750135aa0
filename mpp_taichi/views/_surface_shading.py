"""Shading of surfaces on the device: textures, light from bodies that shine, and the shadows of spheres on spheres.

Only pictures that ask for any of it compile this. All in single precision, whatever the simulation's is.
"""

import math

import taichi as ti

from mpp_taichi.types import Template

LIMB_DARKENING = 0.6  # of a body that shines: I(μ)/I(1) = 1 − u (1 − μ), about the Sun's in visible light
HOT = 0.45  # how white the middle of what shines is
GLOW = 0.35  # of the air and the eye around a light: GLOW (radius/distance)³ …
GLOW_END = 1.5e-4  # … less half of what can be displayed, so that it ends
AMBIENT, DIFFUSE, SPECULAR = 0.12, 0.88, 0.18  # where no body shines


@ti.func
def single(number):
    """A literal in single precision; Taichi gives literals the precision of the simulation."""
    return ti.cast(number, ti.f32)


@ti.func
def highlight(normal, ray, light):
    """Blinn's highlight of exponent 32, seen along a ray.  [Blinn 1977, Comput. Graph. 11, 192]"""
    halfway = light - ray / ti.sqrt(ray.dot(ray))  # not norm(), whose default argument is in the simulation's precision
    shine = ti.max(normal.dot(halfway) / ti.sqrt(halfway.dot(halfway)), single(0.0))
    shine = shine * shine * shine * shine
    shine = shine * shine * shine * shine
    return shine * shine


@ti.func
def texel_light(texels: Template, levels: Template, k):
    """Light of one texel."""
    packed = texels[k]
    red, green, blue = ti.cast(packed & 255, ti.i32), ti.cast(packed >> 8 & 255, ti.i32), ti.cast(packed >> 16 & 255, ti.i32)
    return ti.Vector([levels[red], levels[green], levels[blue]])


@ti.func
def texture_light(material: Template, place: Template, texels: Template, levels: Template, m, normal):
    """Light of the texture of material m where the surface has a normal, between the four nearest texels."""
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
    above = texel_light(texels, levels, upper + left) * (1 - s) + texel_light(texels, levels, upper + right) * s
    below = texel_light(texels, levels, lower + left) * (1 - s) + texel_light(texels, levels, lower + right) * s
    return above * (1 - t) + below * t


@ti.func
def covered_share(a, b, c):
    """Share of a disk of radius a that is covered by one of radius b whose middle is at a distance c from its own."""
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
def seen_share(casters: Template, caster_count, point, to_light, distance, light_radius, index):
    """Share of a light's disk that is seen from a point of particle `index`, past all casters between them.

    Disks are compared in the plane at unit distance from the point; where casters overlap, their shares are multiplied.
    """
    share = single(1.0)
    for k in range(caster_count):
        if casters[k, 4] != index:
            way = ti.Vector([casters[k, 0], casters[k, 1], casters[k, 2]]) - point
            along = way.dot(to_light)
            if along > 0 and along < distance:
                aside = way - along * to_light
                c = ti.sqrt(aside.dot(aside)) / along
                share *= 1 - covered_share(light_radius / distance, casters[k, 3] / along, c)
    return share


@ti.func
def surface_at(table: Template, p, x, y, depth, orthographic):
    """Where the ray through (x, y) meets sphere p at a depth: the ray, the point, and the normal there."""
    ray = ti.Vector([x, y, single(1.0)])
    point = ray * depth
    if orthographic == 1:
        ray = ti.Vector([single(0.0), single(0.0), single(1.0)])
        point = ti.Vector([x, y, depth])
    return ray, point, (point - ti.Vector([table[p, 5], table[p, 6], table[p, 7]])) / table[p, 8]


@ti.func
def shade_surface(
    table: Template,
    material: Template,
    place: Template,
    texels: Template,
    levels: Template,
    lights: Template,
    casters: Template,
    light_count,
    caster_count,
    ambient,
    p,
    x,
    y,
    depth,
    orthographic,
    light,
):
    """Light that reaches the eye from sphere p: by the bodies that shine, or by `light` from afar where none does."""
    color = ti.Vector([table[p, 9], table[p, 10], table[p, 11]])
    ray, point, normal = surface_at(table, p, x, y, depth, orthographic)
    m = ti.cast(table[p, 12], ti.i32)
    shines, specular = single(0.0), single(SPECULAR)
    if m >= 0:
        shines = material[m, 9]
        if place[m, 1] > 0:
            color = texture_light(material, place, texels, levels, m, normal)
            specular = single(0.0)
    if shines > 0:
        toward_eye = ti.max(-normal.dot(ray) / ti.sqrt(ray.dot(ray)), single(0.0))
        white = single(HOT) * toward_eye * toward_eye  # as a film shows what is too bright for it
        color = (color + white * (1 - color)) * (1 - single(LIMB_DARKENING) * (1 - toward_eye))
    elif light_count == 0:
        diffuse = ti.max(normal.dot(light), single(0.0))
        color = color * (single(AMBIENT) + single(DIFFUSE) * diffuse) + specular * highlight(normal, ray, light)
    else:
        albedo = color
        color = albedo * ambient
        for k in range(light_count):
            way = ti.Vector([lights[k, 0], lights[k, 1], lights[k, 2]]) - point
            distance = ti.sqrt(way.dot(way))
            to_light = way / distance
            diffuse = normal.dot(to_light)
            if diffuse > 0:
                share = seen_share(casters, caster_count, point, to_light, distance, lights[k, 3], table[p, 13])
                color += share * (albedo * diffuse + specular * highlight(normal, ray, to_light))
    return color


@ti.func
def glow(lights: Template, glow_count, x, y, depth, orthographic):
    """Light that is seen around bodies that shine, the first so many of the lights, in front of what is behind them."""
    total = ti.Vector([single(0.0), single(0.0), single(0.0)])
    for k in range(glow_count):
        mx, my, mz, size2 = lights[k, 0], lights[k, 1], lights[k, 2], lights[k, 3] * lights[k, 3]
        aside = (mx - x) * (mx - x) + (my - y) * (my - y)
        near = mz
        if orthographic == 0:
            near = (mx * x + my * y + mz) / (x * x + y * y + 1)
            ox, oy, oz = mx - near * x, my - near * y, mz - near
            aside = ox * ox + oy * oy + oz * oz
        if near > 0 and depth > near and aside > size2:
            share = size2 / aside
            strength = single(GLOW) * share * ti.sqrt(share) - single(GLOW_END)
            total += ti.max(strength, single(0.0)) * ti.Vector([lights[k, 4], lights[k, 5], lights[k, 6]])
    return total


@ti.func
def displayed(light, row, column):
    """Light in 0…1 as displayed, red | green << 8 | blue << 16, rounded up or down so that neighbours have the right mean.

    Without that the slow gradients of a glow in a dark sky show as rings.  [sRGB: IEC 61966-2-1]
    """
    mixed = ti.cast(row * 73856093 ^ column * 19349663, ti.u32)  # a fixed number for each pixel, the same in every frame
    mixed = (mixed ^ (mixed >> 16)) * ti.cast(0x7FEB352D, ti.u32)
    mixed = (mixed ^ (mixed >> 15)) * ti.cast(0x2C1B3C6D, ti.u32)
    share = ti.cast((mixed >> 8) & 0xFFFF, ti.f32) * single(1.0 / 65536.0)
    packed = ti.cast(0, ti.u32)
    for channel in ti.static(range(3)):
        level = single(12.92) * light[channel]
        if light[channel] > single(0.0031308):
            level = single(1.055) * ti.pow(light[channel], single(1.0 / 2.4)) - single(0.055)
        shown = ti.min(ti.cast(ti.floor(single(255.0) * level + share), ti.u32), ti.cast(255, ti.u32))
        packed = packed | shown << (8 * channel)
    return packed
