"""Shadows of spheres on the device."""

import math

import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.views._single import single


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
