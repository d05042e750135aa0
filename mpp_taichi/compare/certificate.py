"""Certificate: whether a backend differs from the reference by rounding, or by a bug; every allowance is derived.

Forces. A sum of n terms t_j, each of k roundings of relative size u, computed in any order, differs from the exact one by at
most (k + n) u Σ|t_j|; beyond some terms by (k + λ√n) u Σ|t_j| with the chance 2 exp(−λ²/2) of more, where roundings do not
conspire (Higham & Mary, SIAM J. Sci. Comput. 41 (2019) A2815, thm 2.4); where they may, among the smallest terms, the worst
case is assumed (`NumpyForces.magnitude`). λ is so large that a false alarm in a whole certificate is rarer than CHANCE.
"""

import math
import time as clock
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.compare import numpy_reference, numpy_steps, tree_forces
from mpp_taichi.compare.course import AMPLITUDE, CHANCE, COPIES, ROUNDING, Finding, ReferenceCourse, ratios
from mpp_taichi.compare.evidence import Evidence, shaken
from mpp_taichi.compare.numpy_pairs import ROUNDINGS, Limits
from mpp_taichi.compare.numpy_reference import (
    NumpyForces,
    bodies,
    kept,
    norm,
    pair_forces,
    sample,
    size_of,
)
from mpp_taichi.compare.numpy_steps import Noise, NumpySteps, roundings_per_step
from mpp_taichi.device.thread_count import processors
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.tree_checks import DEFAULT_ACCURACY, tree_of
from mpp_taichi.snapshot import Snapshot

SMALLEST = {"f32": 2.0**-126, "f64": 2.0**-1022}  # normal numbers
MOST_TERMS = 3e7  # of the reference's force sums at each state
TRIAL_STEPS, TRIAL_SECONDS, CLOCK_GRAIN = 16, 0.2, 1e-6  # for the time of a step of the reference
STATES = ("start", "shaken start")
PER_COPY = ("mass", "charge", "stiffness", "damping", "rest_length", "gain")


class Judge:
    """Holds the reference of a scene, and judges backends by it."""

    def __init__(self, spec: SceneSpec, start: Snapshot, dt: float) -> None:
        """`start` is the initial state of every backend, in float64."""
        self.spec, self.start, self.dt = spec, start, dt
        self.force_refusal = numpy_reference.refusal(spec)
        self.step_refusal = self.force_refusal or numpy_steps.refusal(spec)
        self.free = start.free.astype(float)
        self.free[:, spec.dimensions :] = 0.0
        self.size = size_of(start.position)
        self.course: ReferenceCourse | None = None
        splits = component.declaration("integrators", spec.integrator.name).base == "Splitting"
        self._turns = splits and numpy_reference.only_turns(spec, start.springs.damping)
        tree = tree_of(spec)
        self.tree_accuracy = None if tree is None else float(tree.parameters["accuracy"] or DEFAULT_ACCURACY)

    def turns(self, backend: str, precision: str) -> bool:
        """Whether kicks of a backend turn the velocity in closed form, for which Vulkan has no sines in f64."""
        return self._turns and (backend, precision) != ("vulkan", "f64")

    def states(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The states at which forces are compared; see STATES."""
        position, velocity = self.start.position, self.start.velocity * self.start.free
        return [(position, velocity), shaken(position, velocity, self.free, self.size)]

    def reference(self, precision: str) -> NumpyForces:
        """The forces on the particles with the numbers of a precision."""
        return NumpyForces(self.spec, bodies(self.start, self.spec.dimensions, [precision]))

    # Forces

    def forces(self, evidence: Evidence, precision: str) -> list[Finding]:
        """Judge the accelerations by particle and axis; the accelerations of a tree together, except for a few particles."""
        reference = self.reference(precision)
        count = self.start.particle_count
        rows = sample(count, MOST_TERMS)
        looked_at = f"{len(rows):,} of {count:,} particles" if len(rows) < count else f"all {count:,} particles"
        findings = []
        for k, name in enumerate(STATES):
            place, speed = evidence.position[k][None], evidence.velocity[k][None]
            exact = reference.acceleration(place, speed, rows)[0]
            allowed, _ = self._allowed(reference, place, speed, rows, precision)
            off = np.abs(evidence.acceleration[k][rows] - exact)
            if self.tree_accuracy is not None:
                pull = np.where(self.free[rows] > 0.0, reference.of_pairs(place, rows)[0, rows], 0.0)
                findings.append(
                    tree_forces.finding(f"force at the {name}", off, allowed, pull, self.tree_accuracy, rows, count)
                )
                continue
            ratio = ratios(off, allowed)
            row, axis = np.unravel_index(np.argmax(ratio), ratio.shape)
            largest = float(norm(exact).max()) or 1.0
            findings.append(
                Finding(
                    f"force at the {name}",
                    float(ratio[row, axis]),
                    float(off[row, axis]) / largest,
                    float(allowed[row, axis]) / largest,
                    "the largest acceleration",
                    int(rows[row]),
                    looked_at,
                )
            )
        return findings

    def _allowed(
        self, reference: NumpyForces, place: np.ndarray, speed: np.ndarray, rows: np.ndarray, precision: str
    ) -> tuple[np.ndarray, float]:
        """The largest error of each acceleration by rounding, (rows, 3), and as a number of roundings of its terms."""
        terms = reference.most_terms()
        unlikely = math.sqrt(2.0 * math.log(2.0 * len(STATES) * 3.0 * len(rows) / CHANCE))
        roundings = ROUNDINGS + min(terms, unlikely * math.sqrt(terms))
        unit = ROUNDING[precision] + ROUNDING["f64"]
        limits = Limits(unit, SMALLEST[precision])
        size, more = (values[0] for values in reference.magnitude(place, speed, rows, limits))
        worst = float(np.max(norm(more)[norm(size) > 0.0] / norm(size)[norm(size) > 0.0], initial=0.0))
        return roundings * unit * size + more, roundings + worst / unit

    @cached_property
    def roundings(self) -> float:
        """The largest error of a force at the compared states, as a number of roundings of its terms."""
        rows = sample(self.start.particle_count, MOST_TERMS)
        found = []
        for precision in ROUNDING:
            reference = self.reference(precision)
            for place, speed in self.states():
                state = kept(place, precision)[None], kept(speed, precision)[None]
                found.append(self._allowed(reference, *state, rows, precision)[1])
        return max(found)

    def conservation(self, evidence: Evidence, precision: str) -> dict[str, float]:
        """Change of energy and of momentum to the last sample, by the reference's own sums.

        Relative to kinetic + |potential| energy, and to Σ m |v|, the larger value of the start and the end.
        """
        if not len(evidence.steps) or self.start.particle_count**2 > MOST_TERMS:
            return {}
        reference = self.reference(precision)
        mass = reference.bodies.mass[0][:, None]
        first = kept(self.start.position, precision), kept(self.start.velocity * self.start.free, precision)
        ends = (first, (evidence.places[-1], evidence.speeds[-1]))
        (kinetic, potential), (last_kinetic, last_potential) = (
            reference.energy(place[None], speed[None])[0] for place, speed in ends
        )
        momentum = [(mass * speed).sum(axis=0) for _, speed in ends]
        scale = max(float((mass * norm(speed)[:, None]).sum()) for _, speed in ends)
        whole = max(kinetic + abs(potential), last_kinetic + abs(last_potential))
        return {
            "energy_change": float(last_kinetic + last_potential - kinetic - potential) / (whole or 1.0),
            "momentum_change": float(norm(momentum[1] - momentum[0])) / (scale or 1.0),
        }

    # Trajectories

    @property
    def pairs_per_step(self) -> int:
        """Pairs that the reference and its copies sum for each evaluation of the force."""
        return pair_forces(self.spec) * (len(ROUNDING) + 1 + COPIES) * self.start.particle_count**2

    def step_seconds(self) -> float:
        """The seconds of one step of the reference and its copies, without the overhead of samples where steps are short."""
        seen = []
        for steps in (1, TRIAL_STEPS + 1):
            began = clock.perf_counter()
            self.follow(tuple(ROUNDING), [steps])
            seen.append(clock.perf_counter() - began)
            if seen[0] > TRIAL_SECONDS:
                return seen[0]
        return max(seen[1] - seen[0], CLOCK_GRAIN) / TRIAL_STEPS

    def follow(self, precisions: Sequence[str], looks: Sequence[int], *, turns: bool = True) -> ReferenceCourse:
        """Run the reference, once with the numbers of each precision, and its copies beside it.

        Without `turns`, kicks solve forces that turn the velocity to the order of the method.
        """
        random = np.random.default_rng(1)
        method = self.spec.integrator.name
        given = bodies(self.start, self.spec.dimensions, (*precisions, "f64"))
        last = numpy_reference.Bodies(**{**vars(given), **{key: getattr(given, key)[-1:] for key in PER_COPY}})
        near = numpy_reference.perturbed(last, AMPLITUDE, self.roundings, COPIES, random)
        everyone = {key: np.concatenate([getattr(given, key), getattr(near, key)]) for key in PER_COPY}
        reference = NumpyForces(self.spec, numpy_reference.Bodies(**{**vars(given), **everyone}), threads=processors())
        position, velocity = self.start.position, self.start.velocity * self.start.free
        places = np.stack([*(kept(position, precision) for precision in precisions), *[position] * (1 + COPIES)])
        speeds = np.stack([*(kept(velocity, precision) for precision in precisions), *[velocity] * (1 + COPIES)])
        signs = random.choice((-1.0, 1.0), (2, COPIES, *position.shape)) * AMPLITUDE * self.free
        places[-COPIES:] += signs[0] * np.abs(position)
        speeds[-COPIES:] += signs[1] * np.abs(velocity)
        still = np.zeros((len(places) - COPIES, *position.shape))
        times = roundings_per_step(method)
        noise = Noise(*(np.concatenate([still, count * sign]) for count, sign in zip(times, signs)))
        dt = np.full(len(places), self.dt)
        dt[-COPIES:] *= 1.0 + 2.0 * AMPLITUDE * random.choice((-1.0, 1.0), COPIES)
        steps = NumpySteps(reference, method, dt, noise, turns=turns)
        steps.start(places, speeds)
        return self._course(steps, precisions, looks)

    def _course(self, steps: NumpySteps, precisions: Sequence[str], looks: Sequence[int]) -> ReferenceCourse:
        done, seen = 0, []
        count = len(precisions)
        for look in looks:
            steps.advance(look - done)
            done = look
            off = [values[-COPIES:] - values[count] for values in (steps.position, steps.velocity)]
            growth = [norm(values).max(axis=0) / AMPLITUDE for values in off]
            seen.append((steps.position[:count].copy(), steps.velocity[:count].copy(), *growth))
        places, speeds, place_growth, speed_growth = (np.stack(column) for column in zip(*seen))
        typical = float(np.sqrt(np.mean(np.sum(speeds * speeds, axis=3)))) or 1.0
        return ReferenceCourse(
            tuple(precisions),
            np.asarray(looks, int),
            places.swapaxes(0, 1),
            speeds.swapaxes(0, 1),
            place_growth,
            speed_growth,
            self.size,
            typical,
        )


def verdict(findings: Sequence[Finding], refused: str | None = None) -> dict[str, Any]:
    """`rounding` or `bug`, with the finding that decided it; `not judged` without any finding."""
    if not findings:
        return {"verdict": "not judged", "verdict_reason": refused or "there was no time for it", "findings": []}
    deciding = max(findings, key=lambda finding: finding.ratio)
    return {
        "verdict": "rounding" if all(finding.holds for finding in findings) else "bug",
        "verdict_reason": refused or "",
        "decided_by": vars(deciding),
        "findings": [vars(finding) for finding in findings],
    }
