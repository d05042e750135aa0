"""Pairwise contacts: overlaps after a step and their removal.

overlap   depth by which two spheres, or a sphere and a surface, reach into each other [length]
pair      two overlapping spheres i < j; pairs are resolved in the order of (i, j)
row       on a device of many threads: the spheres that overlap one sphere, by number
round     on a device of many threads: the pairs that are resolved at the same time, since they share no sphere
"""
