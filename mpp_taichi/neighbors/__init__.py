"""Pairs of particles: sums over all pairs, the tree of gravity, and the search for spheres that may touch."""
