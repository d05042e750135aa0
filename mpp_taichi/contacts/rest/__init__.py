"""Resting contacts: rows of constraints and the complementarity problem that they make.

row            the entries of one sphere; each pair of spheres has an entry in the rows of both
entry          a sphere or a surface that the sphere of the row could touch by the end of the drift
gap            distance of an entry [length]
impact         an entry that is hit faster than the resting speed within the drift, and rebounds
resting        an entry that only may not approach farther than its gap
yielding       sum of the inverse masses by which an impulse changes a speed [1 / mass]
iteration      one step of the projected gradient method on all impulses
"""
