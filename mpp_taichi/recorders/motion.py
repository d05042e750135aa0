"""The motion of a run before it is filmed, for a camera that chooses its own place and shall show all of it.

The run goes on for a while without recorders and is then taken back, bit for bit. How far it goes follows from the work of its
steps and not from the clock, so that every machine places the camera alike.
"""

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpp_taichi.errors import MppError
from mpp_taichi.simulation.step_work import work_of_step
from mpp_taichi.views.motion_places import chooses_its_place, places_of

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

MOST_WORK = 150_000_000  # in units of `step.plans`: some tenths of a second
MOMENTS = 200
MOST_PLACES = 1_000_000  # particles times moments
LEAST_MOMENTS = 8


def motion_ahead(simulation: "Simulation", span: float) -> np.ndarray | None:
    """Places of all particles during the next `span`, or during its first part where the whole would take too much work.

    Returns their positions as they are drawn and their radii, (moments · count, 4); None where the camera does not need them.
    """
    if not chooses_its_place(simulation.spec) or not simulation.launcher.takes_steps or not span > 0.0:
        return None
    reach = min(span, simulation.time_to_next_phase, simulation.dt * math.floor(MOST_WORK / work_of_step(simulation)))
    moments = min(MOMENTS, int(reach / simulation.dt), MOST_PLACES // max(1, simulation.start.particle_count))
    if moments < LEAST_MOMENTS:
        return None
    before, timings = simulation.bookmark(), replace(simulation.timings)
    begin, found = simulation.time, [places_of(simulation.snapshot(), simulation.spec)]
    try:
        for number in range(1, moments + 1):
            # By whole steps, so that no step is shorter than another.
            steps = round(number * reach / moments / simulation.dt) - round((simulation.time - begin) / simulation.dt)
            if steps > 0:
                simulation.run(steps=steps, judge="off")
                found.append(places_of(simulation.snapshot(), simulation.spec))
    except MppError:
        pass  # a run that breaks down says so when it is filmed
    finally:
        simulation.go_back(before)
        simulation.timings.advance_seconds, simulation.timings.launch_count = timings.advance_seconds, timings.launch_count
    return np.concatenate(found)
