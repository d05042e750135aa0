"""Plots: curves and histograms as plain arrays, drawn into pictures quickly and into files as vectors."""

from mpp_taichi.plots.content import Curves, Histogram, Plot, Samples

__all__ = ["Curves", "Histogram", "Plot", "Samples"]
