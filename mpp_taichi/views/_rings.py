"""Rings on the device; only pictures of views with rings compile this code.

A ring is a thin layer of particles with an optical depth τ, of which exp(−τ/μ) passes along a ray at the cosine μ to its axis.
"""

import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.views._shadows import seen_share
from mpp_taichi.views._single import direction, single
from mpp_taichi.views._texels import packed_light
from mpp_taichi.views.surface_parts import COLORED_LIGHT, RING_TEXELS

DENSEST = 0.998  # opacity beyond which a ring counts as no denser
COARSEST = RING_TEXELS.bit_length() - 1  # level of the mean over the whole ring
FLATTEST = 1.0e-3  # smallest cosine


@ti.func
def ring_at(drawing: Template, k, offset, blur):
    """Colour of ring k and its optical depth at an offset from its middle, averaged over a width of the radius.

    The mean is that between two texels of two levels of the profile; beyond the edges there is nothing.
    """
    rings = ti.static(drawing.rings)
    share = (ti.sqrt(offset.dot(offset)) - rings[k, 6]) / rings[k, 7]
    height = ti.log(ti.max(blur / rings[k, 7] * RING_TEXELS, single(1.0))) * single(1.4426950408889634)  # log₂ of texels
    height = ti.min(height, single(COARSEST))
    total = ti.Vector([single(0.0)] * 4)
    for q in range(4):  # a loop at run time, so that it is compiled once
        level = ti.min(ti.cast(ti.floor(height), ti.i32) + q // 2, COARSEST)
        count = ti.cast(RING_TEXELS, ti.i32) >> level
        u = share * ti.cast(count, ti.f32) - single(0.5)
        column = ti.cast(ti.floor(u), ti.i32) + q % 2
        if 0 <= column < count:
            first = ti.cast(rings[k, 8], ti.i32) + 2 * RING_TEXELS - ((2 * RING_TEXELS) >> level)
            packed = drawing.texels[first + column]
            light = packed_light(drawing, packed)
            weight = ti.abs(single(1.0) - ti.abs(u - ti.cast(column, ti.f32)))
            weight *= ti.abs(ti.cast(1 - q // 2, ti.f32) - (height - ti.floor(height)))
            weight *= ti.cast((packed >> 24) & 255, ti.f32) * single(1.0 / 255.0)
            total += weight * ti.Vector([light[0], light[1], light[2], single(1.0)])
    depth = -ti.log(1 - ti.min(total[3], single(DENSEST)))
    return ti.Vector([total[0], total[1], total[2]]) / ti.max(total[3], single(1e-6)), depth


@ti.func
def meets_ring(drawing: Template, k, offset, blur):
    """Whether ring k may have a texel at an offset from its middle: a texel reaches farther than the edges by half its size."""
    rings = ti.static(drawing.rings)
    radius, margin = ti.sqrt(offset.dot(offset)), blur + rings[k, 7] * single(1.0 / RING_TEXELS)
    return radius > rings[k, 6] - margin and radius < rings[k, 6] + rings[k, 7] + margin


@ti.func
def ring_vectors(drawing: Template, k):
    """Middle and axis of ring k."""
    rings = ti.static(drawing.rings)
    return ti.Vector([rings[k, 0], rings[k, 1], rings[k, 2]]), ti.Vector([rings[k, 3], rings[k, 4], rings[k, 5]])


@ti.func
def radial_gradient(offset, axis, ray):
    """The change of the radius where a ray meets a ring, over a shift of the ray: a vector across the ray."""
    outward = direction(offset)
    return outward - axis * (outward.dot(ray) / axis.dot(ray))


@ti.func
def share_through_rings(drawing: Template, point, to_light, distance, light_radius):
    """Share of the light that reaches a point of a sphere through all rings."""
    share = single(1.0)
    for k in range(drawing.ring_count):
        middle, axis = ring_vectors(drawing, k)
        cosine = axis.dot(to_light)
        if ti.abs(cosine) > single(FLATTEST):
            along = axis.dot(middle - point) / cosine
            if along > 0 and along < distance:
                offset = point + along * to_light - middle
                gradient = radial_gradient(offset, axis, to_light)
                blur = 2 * along * light_radius / distance * ti.sqrt(gradient.dot(gradient))
                if meets_ring(drawing, k, offset, blur):
                    _, depth = ring_at(drawing, k, offset, blur)
                    share *= ti.exp(-depth / ti.abs(cosine))
    return share


@ti.func
def scattered(depth, toward_eye, toward_light):
    """Light that a layer scatters once, over the light of an opaque layer of which eye and light are equally high.

    By the cosines μ and μ₀ of eye and light to the axis, with equal signs on one side of the layer:
    2 μ₀/(μ₀ + μ) (1 − exp(−τ/μ − τ/μ₀)) on the lit side, 2 μ₀/(μ₀ − μ) (exp(−τ/μ₀) − exp(−τ/μ)) on the other.
    [Chandrasekhar 1960, Radiative Transfer]
    """
    eye, light = ti.max(ti.abs(toward_eye), single(FLATTEST)), ti.max(ti.abs(toward_light), single(FLATTEST))
    if ti.abs(light - eye) < single(FLATTEST):
        light = eye + single(FLATTEST)  # the limit of equal cosines, without a division by zero
    found = 2 * light / (light + eye) * (1 - ti.exp(-depth / eye - depth / light))
    if toward_eye * toward_light < 0:
        found = 2 * light / (light - eye) * (ti.exp(-depth / light) - ti.exp(-depth / eye))
    return found


@ti.func
def ring_light(drawing: Template, point, axis, ray, color, depth):
    """Light that a ring sends to the eye from a point."""
    lights = ti.static(drawing.lights)
    toward_eye = -axis.dot(direction(ray))
    total = color * drawing.ambient * (1 - ti.exp(-depth / ti.max(ti.abs(toward_eye), single(FLATTEST))))
    if drawing.light_count == 0:
        total += color * scattered(depth, toward_eye, axis.dot(drawing.light))
    for q in range(drawing.light_count):
        way = ti.Vector([lights[q, 0], lights[q, 1], lights[q, 2]]) - point
        distance = ti.sqrt(way.dot(way))
        to_light = way * (single(1) / distance)
        light = color * scattered(depth, toward_eye, axis.dot(to_light))
        if ti.static(drawing.surfaces & COLORED_LIGHT):
            light *= ti.Vector([lights[q, 7], lights[q, 8], lights[q, 9]])
        total += light * seen_share(drawing, point, to_light, distance, lights[q, 3], single(-1.0))
    return total


@ti.func
def through_rings(drawing: Template, x, y, depth, behind):
    """Light along the ray through (x, y) that comes from behind all rings before a depth, and from these rings."""
    light = behind
    for k in range(drawing.ring_count):
        middle, axis = ring_vectors(drawing, k)
        ray, start = ti.Vector([x, y, single(1.0)]), ti.Vector([single(0.0)] * 3)
        if drawing.orthographic == 1:
            ray, start = ti.Vector([single(0.0), single(0.0), single(1.0)]), ti.Vector([x, y, single(0.0)])
        slant = axis.dot(ray)
        if ti.abs(slant) > single(1e-6):
            along = axis.dot(middle - start) / slant
            if along > 0 and along < depth:
                point = start + ray * along
                gradient = radial_gradient(point - middle, axis, ray)
                pixel = drawing.per_pixel
                if drawing.orthographic == 0:
                    pixel *= along
                blur = pixel * ti.sqrt(gradient[0] * gradient[0] + gradient[1] * gradient[1])
                if meets_ring(drawing, k, point - middle, blur):
                    color, thickness = ring_at(drawing, k, point - middle, blur)
                    passes = ti.exp(-thickness / ti.max(ti.abs(axis.dot(direction(ray))), single(FLATTEST)))
                    light = light * passes + ti.min(ring_light(drawing, point, axis, ray, color, thickness), single(1.0))
    return light
