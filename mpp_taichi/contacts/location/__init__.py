"""Contacts located on the paths of the steps of an adaptive method.

path      polynomial of the position of a sphere over a step
share     part of a step, 0 … 1
gap       distance of two surfaces, negative where they overlap [length]
rate      derivative of a gap with the share [length]
bend      bound of the second derivative of a path with the share [length]
blur      bound of the rounding of a position [length]
wait      share for which a contact is certainly not possible
"""
