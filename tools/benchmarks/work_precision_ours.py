"""Our runs in benchmark_work_precision.py: each of our methods on one problem.

A run is (label, function); the function returns the positions at the end and the seconds of processor time of the stepping
alone. Nothing is compiled before the first call of such a function.
"""

import time

import numpy as np
from work_precision_ladder import HALF_DECADES, step_counts, warm

# Of a method of fixed step: integrator, its options, evaluations of the force in a step. A name with ° wants a centre.
FIXED = {
    "leapfrog": ("leapfrog", {}, 1),
    "pefrl": ("pefrl", {}, 4),
    "srkn6b": ("srkn6b", {}, 6),
    "srkn11b": ("srkn11b", {}, 11),
    "srkn14a": ("srkn14a", {}, 14),
    "kahan_li8": ("kahan_li8", {}, 17),
    "rkn8": ("rkn8", {}, 17),
    "dop853": ("dop853", {}, 12),
    "wisdom_holman°": ("wisdom_holman", {}, 1),
    "wisdom_holman° 17": ("wisdom_holman", {"corrector": 17}, 1),
    "wisdom_holman° lazy": ("wisdom_holman", {"corrector": 17, "kernel": "lazy"}, 1),
}
# Of a method that chooses its steps: integrator, options, the parameter that controls it, its values.
ADAPTIVE = {
    "adaptive_leapfrog": ("adaptive_leapfrog", {}, "step", 0.1 / np.sqrt(10.0) ** np.arange(7)),
    "adaptive_dop853": ("adaptive_dop853", {}, "tolerance", 10.0 ** -np.arange(3.0, 15.0)),
    "ias15": ("ias15", {}, "epsilon", 10.0 ** -np.arange(3.0, 10.0, 0.5)),
    "taylor": ("taylor", {}, "tolerance", HALF_DECADES),
    "taylor 9": ("taylor", {"order": 9}, "tolerance", HALF_DECADES[:13]),
    "taylor 13": ("taylor", {"order": 13}, "tolerance", HALF_DECADES[:17]),
    "taylor 28": ("taylor", {"order": 28}, "tolerance", HALF_DECADES[13:]),
}
FOR_GRAVITY = ("adaptive_leapfrog", "taylor", "taylor 9", "taylor 13", "taylor 28")


def our_runs(problem):
    """{contender: runs} of all our methods that suit the problem."""
    found = {}
    for name, (method, options, evaluations) in FIXED.items():
        if problem.centre or "°" not in name:
            counts = step_counts(problem, evaluations, centred="°" in name)
            found[name] = runs_of(problem, method, options, [(problem.span / n, n, {}) for n in counts])
    for name, (method, options, control, values) in ADAPTIVE.items():
        if not (problem.on_springs and name in FOR_GRAVITY):
            found[name] = runs_of(problem, method, options, [(value, 2, {control: float(value)}) for value in values])
    return found


def is_ours(contender):
    """Whether a contender is one of our methods, of this or of an earlier run."""
    return not contender.startswith(("rebound", "scipy", "heyoka"))


class Ours:
    """One of our methods on a problem, compiled when it is first run; the step and the tolerance are arguments of kernels."""

    def __init__(self, problem, method, options):
        """Not compiled yet."""
        self.problem, self.method, self.options, self.simulation = problem, method, options, None

    def scene(self, setting):
        """The scene of the problem."""
        problem, bodies = self.problem, []
        for i, (m, x, v) in enumerate(zip(problem.mass, problem.x, problem.v)):
            body = {"name": f"b{i}", "mass": float(m), "position": x.tolist(), "velocity": v.tolist()}
            bodies.append({"body": body | ({"free": False} if problem.held[i] else {})})
        dt = problem.span / 2
        scene = {"particles": bodies, "integrator": {self.method: {"dt": dt, **self.options, **setting}}}
        if problem.g:
            scene["forces"] = [{"newtonian_gravity": {"strength": problem.g}}]
        if problem.on_springs:
            kind = {"stiffness": problem.stiffness, "rest_length": problem.rest_length}
            scene["springs"] = [{"link": {"between": [f"b{i}", f"b{j}"], **kind}} for i, j in problem.ends]
        return scene

    def _once(self, steps, setting):
        simulation, span = self.simulation, self.problem.span
        for name, value in setting.items():
            setattr(simulation.integrator, name, value)
        simulation.restart()
        simulation.launcher.prepare(0.0, span / steps)
        began = time.process_time()
        simulation.launcher.advance(0.0, span / steps, 0, steps)
        return time.process_time() - began

    def run(self, steps, setting):
        """Positions at the end, and seconds of the stepping."""
        if self.simulation is None:
            from mpp_taichi import Simulation

            self.simulation = Simulation(self.scene(setting), backend="cpu", precision="f64", plan="serial")
            self._once(1, setting)
        seconds = warm(lambda: self._once(steps, setting))
        return self.simulation.state.read()[0], seconds


def runs_of(problem, method, options, settings):
    """Runs of one of our methods; `settings` are (value in the label, steps or samples, parameters)."""
    compiled = Ours(problem, method, options)
    words = " ".join(f"{name} {value}" for name, value in options.items())
    label = f"{method} ({words})" if words else method
    return [
        (f"{label} {value:.3g}", lambda steps=steps, setting=setting: compiled.run(steps, setting))
        for value, steps, setting in settings
    ]
