"""Restitution of one contact: elastic where it follows another contact too soon (the TC model).

Source: Luding & McNamara, Granular Matter 1 (1998) 113.
"""

import taichi as ti

from mpp_taichi.types import Template


@ti.func
def restitution_after(nominal, since, contact_time: Template):
    """The e of a contact that comes the time `since` after the last contact of either sphere, and 1 if that made it elastic.

    Within the `contact_time` the contact is elastic, else its restitution is the `nominal` one; a `contact_time` of 0 turns
    the rule off.
    """
    e, elastic = ti.cast(nominal, float), 0
    if ti.static(contact_time > 0.0):
        if since < contact_time and e < 1.0:
            e, elastic = 1.0, 1
    return e, elastic


@ti.func
def restitution_at(time, nominal, i, j, last_contact: Template, contact_time: Template):
    """Restitution of a contact of spheres i and j at `time`, which is noted in the field `last_contact` of both.

    The field is neither read nor written where the rule is off. For a contact with a surface, j is i.
    """
    e, elastic = ti.cast(nominal, float), 0
    if ti.static(contact_time > 0.0):
        e, elastic = restitution_after(nominal, time - ti.max(last_contact[i], last_contact[j]), contact_time)
        last_contact[i] = time
        last_contact[j] = time
    return e, elastic
