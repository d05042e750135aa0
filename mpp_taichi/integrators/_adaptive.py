"""Adaptive methods: steps of their own choice, and a look at any time between."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.integrators._base import Integrator
from mpp_taichi.types import Template


class Adaptive(Integrator):
    """Takes steps as long as its error control allows, and shows the state at other times by its own polynomial.

    `dt` is the time between two looks; the motion does not depend on it. What a step hands on to the next is `memory`: between
    two looks the true state is there, and `position` and `velocity` hold what is shown. For each replica `clock` has the begin
    and length of the last step, and the length of the next [time]; `tally` the steps taken, the steps refused, the evaluations
    of the force, and whether the step fell below what the time can resolve.
    """

    adaptive = True
    CLOCK = 3
    TALLY = 4
    STEPS, REFUSED, EVALUATIONS, STALLED = range(4)

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """The exact one: no step is too long, as `dt` is not the step. exp of [[0, 1], [−ω², −γ]] by its eigenvalues."""
        matrix = np.array([[0.0, 1.0], [-(frequency**2), -damping]])
        root = np.emath.sqrt(damping**2 / 4 - frequency**2)
        shifted = matrix + damping / 2 * np.eye(2)
        ratio = np.sinh(root) / root if root != 0 else 1.0
        return np.real(np.exp(-damping / 2) * (np.cosh(root) * np.eye(2) + ratio * shifted))

    @ti.func
    def begin(self, state: Template, total_force: Template, first, time: Template, dt: Template, shape: Template):
        """Take the state as it is at `time`, with nothing known of it."""

    @ti.func
    def advance_to(self, state: Template, total_force: Template, first, end: Template, shape: Template):
        """Take steps until one ends at `end` or later."""

    @ti.func
    def show(self, state: Template, total_force: Template, first, time: Template):
        """Positions and velocities at a time within the last step."""
