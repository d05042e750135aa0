"""Drifts by a sweep: islands of spheres are played event by event.

drift       straight flight of all spheres for a given time, with the contacts on the way
piece       part of a drift, short enough for small margins; most drifts are one piece
slot        place of a sphere in the order of the cell grid; spheres that are near in space have near slots
margin      distance from its start that a sphere may cover in a piece; its reach is radius + margin
candidate   pair whose reaches overlap, so that it may touch in the piece
skin        distance by which the cell grid reaches farther than the margins, so that it is good for several drifts
stale       no longer valid: a grid whose skin is used up, or an event whose partner has had another contact
island      set of spheres whose contacts in the piece may depend on each other; one thread plays it
link        two spheres that belong to one island; links are noted first, and islands are formed of them later
event       next contact of a sphere; the earliest event of an island happens first
group       the contacts that touch at one instant, where they are resolved together
"""
