"""The runs of REBOUND, SciPy and heyoka in benchmark_work_precision.py, in the form of work_precision_ours.py."""

import time

import numpy as np
from work_precision_ladder import step_counts, warm

# Of REBOUND: integrator, its attributes, evaluations of the force in a step, 0 where it chooses its steps.
REBOUND = {
    "rebound leapfrog": ("leapfrog", {}, 1),
    "rebound leapfrog 8": ("leapfrog", {"order": 8}, 17),
    "rebound whfast°": ("whfast", {"safe_mode": 0}, 1),
    "rebound whfast° corrected": ("whfast", {"safe_mode": 0, "corrector": 17}, 1),
    "rebound whfast° lazy": ("whfast", {"safe_mode": 0, "corrector": 17, "kernel": "lazy"}, 1),
    "rebound saba° 10_6_4": ("saba", {"safe_mode": 0, "type": "10_6_4"}, 8),
    "rebound saba° CL_4": ("saba", {"safe_mode": 0, "type": "CL_4"}, 5),
    "rebound ias15": ("ias15", {}, 0),
    "rebound bs": ("bs", {}, 0),
}
REBOUND_CONTROLS = {
    "ias15": ("epsilon", 10.0 ** -np.arange(3.0, 10.0, 0.5)),
    "bs": ("eps_rel", 10.0 ** -np.arange(4.0, 16.0)),
}
# Its order ⌈1 − ½ ln ε⌉ follows from the tolerance, its step from the order: one tolerance for each of the orders 4 … 20.
HEYOKA_TOLERANCES = 1.001 * np.exp(-2.0 * (np.arange(4.0, 21.0) - 1.0))
SCIPY_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 3e-14)


def other_runs(problem):
    """{contender: runs} of all that suit the problem: REBOUND knows no springs between bodies."""
    found = {}
    for name, (method, options, evaluations) in REBOUND.items():
        if not problem.on_springs and (problem.centre or "°" not in name):
            counts = step_counts(problem, evaluations, centred="°" in name) if evaluations else []
            found[name] = rebound_runs(problem, method, options, counts)
    return found | {"scipy dop853": scipy_runs(problem), "heyoka": heyoka_runs(problem)}


def rebound_runs(problem, method, options, counts):
    """Runs of one of REBOUND's integrators, of fixed steps or of its control."""
    import rebound

    def simulation(setting):
        s = rebound.Simulation()
        s.G, s.integrator = problem.g, method
        for m, x, v in zip(problem.mass, problem.x, problem.v):
            s.add(m=m, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])
        for name, value in {**options, **setting}.items():
            setattr(s.integrator, name, value)
        return s

    def runner(steps, setting):
        kept = []

        def once():
            s = simulation(setting)
            kept[:] = [s]
            if steps:
                s.dt = problem.span / steps
            began = time.process_time()
            if steps:
                s.steps(steps)  # `integrate` may take one more, where the sum of the steps is rounded down
                s.synchronize()
            else:
                s.integrate(problem.span)
            return time.process_time() - began

        def run():
            seconds = warm(once)
            return np.array([p.xyz for p in kept[0].particles]), seconds

        return run

    words = " ".join(str(value) for name, value in options.items() if name != "safe_mode")
    label = f"{method} {words}".strip()
    if counts:
        return [(f"{label} {problem.span / n:.3g}", runner(n, {})) for n in counts]
    control, values = REBOUND_CONTROLS[method]
    floor = {"eps_abs": 1e-3} if method == "bs" else {}
    settings = [{control: value, **{name: part * value for name, part in floor.items()}} for value in values]
    return [(f"{label} {setting[control]:.3g}", runner(0, setting)) for setting in settings]


def scipy_runs(problem):
    """DOP853 with tolerances, and the right-hand side in NumPy."""
    from scipy.integrate import solve_ivp

    derivative = spring_derivative(problem) if problem.on_springs else gravity_derivative(problem)
    start, shape = np.concatenate([problem.x, problem.v]).ravel(), problem.x.shape

    def runner(tolerance):
        def run():
            began = time.process_time()
            found = solve_ivp(derivative, (0, problem.span), start, "DOP853", t_eval=[problem.span],
                              rtol=tolerance, atol=tolerance * 1e-3 * problem.size)  # fmt: skip
            return found.y[:, -1].reshape(2, *shape)[0], time.process_time() - began

        return run

    return [(f"dop853 {tolerance:g}", runner(tolerance)) for tolerance in SCIPY_TOLERANCES]


def signs_over_mass(problem):
    """(n, p): +1/m for the first body of a pair, −1/m for the second one, 0 for held bodies, and the pairs (2, p)."""
    pairs = problem.ends.T if problem.on_springs else np.array(np.triu_indices(len(problem.mass), 1))
    found, order = np.zeros((len(problem.mass), pairs.shape[1])), np.arange(pairs.shape[1])
    found[pairs[0], order], found[pairs[1], order] = 1.0, -1.0
    return found * (~problem.held / problem.mass)[:, None], pairs


def gravity_derivative(problem):
    """Velocities and accelerations of a state, over all pairs once."""
    signs, (i, j) = signs_over_mass(problem)
    shape, strength = problem.x.shape, problem.g * problem.mass[i] * problem.mass[j]

    def derivative(_, y):
        x, v = y.reshape(2, *shape)
        d = x[j] - x[i]
        squared = (d * d).sum(1)
        pull = strength / (squared * np.sqrt(squared))
        return np.concatenate([v, signs @ (pull[:, None] * d)]).ravel()

    return derivative


def spring_derivative(problem):
    """Velocities and accelerations of a state, over all springs."""
    signs, (i, j) = signs_over_mass(problem)
    shape = problem.x.shape

    def derivative(_, y):
        x, v = y.reshape(2, *shape)
        d = x[j] - x[i]
        pull = problem.stiffness * (1.0 - problem.rest_length / np.sqrt((d * d).sum(1)))
        return np.concatenate([v, signs @ (pull[:, None] * d)]).ravel()

    return derivative


def heyoka_runs(problem):
    """Its Taylor method in f64, compilation apart."""

    def runner(tolerance):
        made = []  # once, at the first run

        def run():
            if not made:
                integrator = problem.heyoka(float, tolerance)
                made.extend([integrator, np.array(integrator.state)])
            integrator, start = made

            def once():
                integrator.time, integrator.state[:] = 0.0, start
                began = time.process_time()
                integrator.propagate_until(problem.span)
                return time.process_time() - began

            seconds = warm(once)
            return problem.placed(integrator.state), seconds

        return run

    return [(f"taylor {tolerance:.3g}", runner(tolerance)) for tolerance in HEYOKA_TOLERANCES]
