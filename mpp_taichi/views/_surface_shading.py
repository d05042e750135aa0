"""Shading of surfaces on the device: light from bodies that shine and from afar.

Only pictures with textures, shining bodies or shadows compile this code. All numbers are in single precision, whatever the
precision of the simulation.
"""

import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.views._rings import share_through_rings
from mpp_taichi.views._shadows import seen_share
from mpp_taichi.views._single import direction, single
from mpp_taichi.views._surface_maps import clouds_over, gloss_at, night_light, share_of_night, sloping_light, sloping_normal
from mpp_taichi.views._texels import texture_light
from mpp_taichi.views.surface_parts import (
    CLOUDS,
    CLOUDS_AT,
    COLORED_LIGHT,
    GLOSS,
    GLOSS_AT,
    NIGHT,
    NIGHT_AT,
    RELIEF,
    RELIEF_AT,
    RINGS,
    SHINES,
    TEXTURE_AT,
)

LIMB_DARKENING = 0.6  # of a body that shines: I(μ)/I(1) = 1 − u (1 − μ), about the Sun's in visible light
HOT = 0.45  # share of white in the middle of a shining body
GLOW = 0.35  # of the air and the eye around a light: GLOW (radius/distance)³ …
GLOW_END = 1.5e-4  # … less half of the smallest displayed value, so that the glow ends
AMBIENT, DIFFUSE, SPECULAR = 0.12, 0.88, 0.18  # in scenes without a shining body


@ti.func
def highlight(normal, ray, light):
    """Blinn's highlight of exponent 32, seen along a ray.  [Blinn 1977, Comput. Graph. 11, 192]"""
    shine = ti.max(normal.dot(direction(light - direction(ray))), single(0.0))
    shine = shine * shine * shine * shine
    shine = shine * shine * shine * shine
    return shine * shine


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
    ground, clear, dark = normal, single(1.0), single(1.0)
    gloss = ti.Vector([single(0.0), single(0.0), single(0.0)])
    if m >= 0:
        shines = material[m, SHINES]
        if drawing.place[m, TEXTURE_AT + 1] > 0:
            color = texture_light(drawing, m, normal)
            specular = single(0.0)
        if ti.static(drawing.surfaces & RELIEF):
            if drawing.place[m, RELIEF_AT + 1] > 0:
                ground = sloping_normal(drawing, m, normal)
        if ti.static(drawing.surfaces & GLOSS):
            if drawing.place[m, GLOSS_AT + 1] > 0:
                gloss = gloss_at(drawing, m, normal)
                specular = single(0.0)
        if ti.static(drawing.surfaces & CLOUDS):
            if drawing.place[m, CLOUDS_AT + 1] > 0:
                cloud = clouds_over(drawing, m, normal)
                clear = 1 - cloud[3]
                color = color * clear + ti.Vector([cloud[0], cloud[1], cloud[2]])
                ground = direction(ground * clear + normal * cloud[3])
                specular *= clear
                gloss *= clear
    if shines > 0:
        toward_eye = ti.max(-normal.dot(direction(ray)), single(0.0))
        white = single(HOT) * toward_eye * toward_eye  # as a film shows light that is too bright for it
        color = (color + white * (1 - color)) * (1 - single(LIMB_DARKENING) * (1 - toward_eye))
    elif drawing.light_count == 0:
        color = lit_from_afar(drawing, color, ground, ray, specular)
        if ti.static(drawing.surfaces & GLOSS):
            if normal.dot(drawing.light) > 0:
                color += gloss * highlight(ground, ray, drawing.light)
    else:
        albedo = color
        color = albedo * drawing.ambient
        for k in range(drawing.light_count):
            way = ti.Vector([lights[k, 0], lights[k, 1], lights[k, 2]]) - point
            distance = ti.sqrt(way.dot(way))
            to_light = way * (single(1) / distance)
            diffuse = normal.dot(to_light)
            if ti.static(drawing.surfaces & NIGHT):
                dark *= share_of_night(diffuse)
            if ti.static(drawing.surfaces & (RELIEF | CLOUDS)):
                diffuse = sloping_light(diffuse, ground.dot(to_light))
            if diffuse > 0:
                light = albedo * diffuse
                if specular > 0:
                    light += specular * highlight(ground, ray, to_light)
                if ti.static(drawing.surfaces & GLOSS):
                    light += gloss * highlight(ground, ray, to_light)
                if ti.static(drawing.surfaces & COLORED_LIGHT):
                    light *= ti.Vector([lights[k, 7], lights[k, 8], lights[k, 9]])
                if ti.static(drawing.surfaces & RINGS):
                    light *= share_through_rings(drawing, point, to_light, distance, lights[k, 3])
                color += light * seen_share(drawing, point, to_light, distance, lights[k, 3], drawing.table[p, 13])
        if ti.static(drawing.surfaces & NIGHT):
            if m >= 0 and dark > 0:
                if drawing.place[m, NIGHT_AT + 1] > 0:
                    color += night_light(drawing, m, normal) * (dark * clear)
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
