"""Horizon: the time until which the positions of a run are right to a thousandth of the system's size."""
