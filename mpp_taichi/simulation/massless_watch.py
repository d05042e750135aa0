"""Massless and light particles under the blow-up watch: the total energy does not contain, or does not show, their energies."""

from typing import Any

import numpy as np

from mpp_taichi.energy.specific_energy import SpecificEnergies, SpecificEnergyMeter
from mpp_taichi.errors import StabilityError
from mpp_taichi.simulation import first_bad_step
from mpp_taichi.simulation.saved_state import Mark
from mpp_taichi.wording.told_apart import told_apart

ALARM = 1.0  # times its mean kinetic energy so far: a particle that gains more is on another orbit
ALARM_NOW = 0.5  # times its present kinetic energy: near a pericentre a method's energy swings by less, and swings back
ONSET = 0.1  # of the mean kinetic energy: a change below it is sound
CONFIRMED = 0.5  # of a gain: smaller steps that give it to within this share confirm it
ROUNDING = 64.0  # machine epsilons of the energies, by which their difference may be rounded
MOST_SAMPLES = 8  # for which the last sound state is kept: an energy that changes more slowly is no blow-up
LOOKS = 250  # strides in which a suspicious stretch is followed again
FINER = 4  # factor of the number of steps from each repetition of the stretch to the next
MOST_STEPS = 50_000  # of such a repetition


class MasslessWatch:
    """Judges the energy per mass of massless and light particles, and repeats a suspicious stretch of a run with smaller steps.

    Moving bodies give energy to particles and take it, so a gain by itself proves nothing. A gain is suspicious if it is larger
    than the mean kinetic energy of the particle and than half of its present one, both in the frame of the scene and in the
    frame of its attractor. The stretch of the run in which it came is then repeated with smaller steps: a gain that they
    confirm is physical, and the particle is judged by its new energy from then on. Costs a copy of the state for each sample,
    and nothing in a scene without massless particles.
    """

    def __init__(self) -> None:
        """Watch from the first sample on."""
        self._meter: SpecificEnergyMeter | None = None

    def restart(self) -> None:
        """Watch from the next sample on, which becomes the start."""
        self._meter = None

    def record(self, simulation: Any) -> None:
        """Judge the state of a sample.

        Raises:
            StabilityError: a particle gained energy that smaller steps do not confirm; the simulation stands before that.
        """
        if self._meter is None:
            self._begin(simulation)
        assert self._meter is not None
        if not len(self._meter.rows):
            return
        now = self._look(simulation)
        suspects = np.flatnonzero(self._is_suspicious(now))
        if len(suspects):
            self._examine(simulation, suspects)
        if len(suspects) or self._samples - self._sound_sample >= MOST_SAMPLES or not self._has_changed(now).any():
            self._accept(simulation, now)
        self._kinetic_sum += now.kinetic
        self._samples += 1

    def _begin(self, simulation: Any) -> None:
        start = simulation.snapshot()
        self._meter = SpecificEnergyMeter(simulation.spec, start)
        if not len(self._meter.rows):
            return
        self._epsilon = 2.0**-53 if simulation.device.precision == "f64" else 2.0**-24
        self._reference = self._look(simulation)
        self._kinetic_sum = np.zeros_like(self._reference.kinetic)
        self._samples = self._sound_sample = 0
        self._sound: Mark = simulation.mark()

    def _accept(self, simulation: Any, now: SpecificEnergies) -> None:
        """Take this state as sound; particles whose energy has changed are judged by the new energy."""
        changed, old = self._has_changed(now), self._reference
        self._reference = SpecificEnergies(
            np.where(changed, now.kinetic, old.kinetic),
            np.where(changed, now.potential, old.potential),
            np.where(changed, now.attractor, old.attractor),
        )
        self._sound, self._sound_sample = simulation.mark(), self._samples

    def _look(self, simulation: Any) -> SpecificEnergies:
        assert self._meter is not None
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            return self._meter.measure(simulation.snapshot())

    def _mean_kinetic(self, now: SpecificEnergies) -> np.ndarray:
        return (self._kinetic_sum + now.kinetic) / (self._samples + 1)

    def _is_suspicious(self, now: SpecificEnergies) -> np.ndarray:
        limit = np.maximum(ALARM * self._mean_kinetic(now), ALARM_NOW * now.kinetic)
        return self._exceeds(now.energy - self._reference.energy, now, limit)

    def _has_changed(self, now: SpecificEnergies) -> np.ndarray:
        return self._exceeds(np.abs(now.energy - self._reference.energy), now, ONSET * self._mean_kinetic(now))

    def _exceeds(self, change: np.ndarray, now: SpecificEnergies, limit: np.ndarray) -> np.ndarray:
        """Whether a change exceeds limit and rounding in both frames, (n,); two attractors are not compared."""
        sizes = now.kinetic + np.abs(now.potential) + self._reference.kinetic + np.abs(self._reference.potential)
        above = change > limit + ROUNDING * self._epsilon * sizes
        above[1] |= now.attractor != self._reference.attractor
        return above.all(axis=0)

    def _examine(self, simulation: Any, suspects: np.ndarray) -> None:
        """Repeat the stretch that led to a suspicious gain; leaves the state as it was, or raises StabilityError."""
        here = simulation.mark()
        before, steps, found = self._narrow(simulation, suspects, max(1, here.step - self._sound.step))
        time, dt = simulation.time, simulation.dt
        coarse = finer = found.energy[0, suspects]
        start, usual = self._reference.energy[0, suspects], self._mean_kinetic(self._reference)[0, suspects]
        gain, parts, agree = coarse - start, 1, False
        while parts < FINER**2 or (not agree and steps * parts * FINER <= MOST_STEPS):
            coarser, parts = finer, parts * FINER
            simulation.return_to(before)
            simulation.try_steps(steps * parts, dt / parts)
            finer = self._look(simulation).energy[0, suspects]
            agree = bool(np.all(np.abs(finer - coarser) <= ONSET * np.maximum(usual, np.abs(finer - start))))
        wrong = ~(np.abs(finer - coarse) <= CONFIRMED * gain)
        if not wrong.any():
            simulation.return_to(here)
            return
        worst = int(np.argmax(np.where(wrong, gain, -np.inf)))
        self._go_back(simulation, before, steps, int(suspects[worst]))
        first, last, with_smaller = told_apart(start[worst], coarse[worst], finer[worst])
        told = f"rises from {first} to {last} at time {time:.6g}"
        cure = "smaller steps do not agree with each other: give the force a softening"
        if agree:
            cure = f"with smaller steps to {with_smaller}; the step is too large for what happens there: "
            cure += f"try dt = {dt * FINER / parts:.3g}, or a softening"
        raise self._error(simulation, int(suspects[worst]), f"{told}, {cure}")

    def _narrow(self, simulation: Any, suspects: np.ndarray, steps: int) -> tuple[Mark, int, SpecificEnergies]:
        """The last sound state before the gain, the steps from there to it, and the energies after it; the run stays there."""
        simulation.return_to(self._sound)
        before, count, stride = self._sound, 0, -(-steps // LOOKS)
        now = self._reference
        for _ in range(0, steps, stride):
            simulation.try_steps(stride)
            now, count = self._look(simulation), count + stride
            if self._is_suspicious(now)[suspects].any():
                break
            if not self._has_changed(now)[suspects].any():
                before, count = simulation.mark(), 0
        if count == 0:  # a shorter last step led to the gain
            before, count = self._sound, steps
        return before, count, now

    def _go_back(self, simulation: Any, before: Mark, steps: int, suspect: int) -> None:
        """Go to the last step after which the energy of the particle is sound."""
        stored = [before]

        def advance(count: int) -> bool:
            return simulation.try_steps(count) and not self._has_changed(self._look(simulation))[suspect]

        def keep() -> None:
            stored[0] = simulation.mark()

        first_bad_step.first_bad_step(steps, advance, keep, lambda: simulation.return_to(stored[0]))

    def _error(self, simulation: Any, suspect: int, told: str) -> StabilityError:
        """The error for a run that stands at the last sound step."""
        assert self._meter is not None
        particle = int(self._meter.rows[suspect])
        step, time = simulation.step_count + 1, simulation.time + simulation.dt
        now = simulation.snapshot()
        label, mass = first_bad_step.label(now, particle), now.mass[particle]
        which = "which is massless" if mass == 0.0 else f"whose mass of {mass:.3g} is too small for the total energy"
        error = StabilityError(
            f"step {step}, time {time:.9g}: from here the run blows up: the energy per mass of {label}, {which}, {told}"
        )
        error.step, error.time, error.particle = step, time, particle
        return error
