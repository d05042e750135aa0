"""Spheres that merge at their contact.

meeting   contact of two spheres, which become one
agenda    list of the meetings and of the contacts with surfaces that are to come in a drift
entry     one of them: time, sphere i, and sphere j or, as −1 − s, surface s
"""
