"""What the tolerance of each adaptive method means: its error per orbit on six problems, beside SciPy's DOP853 and heyoka.

    python tools/benchmarks/measure_tolerance.py [--methods taylor …] [--json FILE]

Kepler      e = 0, 0.5, 0.9 and 0.99, masses 1 and 1e-3. The start is the end of the minor axis before the pericentre, where the
            distance is the semi-major axis and the speed its root mean square over time. A wrong energy makes a wrong period,
            which counts again in each later orbit, so the error of an orbit is the largest over n = 1, 2, 3, 5 and 10 orbits
            of the error after n orbits over n (n + 1)/2.
Pleiades    seven bodies to t = 3 (Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993) p. 245):
            the error at the end.
Planets     sun, giants and Pluto over 46 orbits of Jupiter, 200,000 days: the error at the end over 46.

Errors are the largest of a body over the root mean square distance from the centre of mass at the start (of Kepler's problem:
at the mean distance), against closed forms and heyoka in long double. The table holds the error per orbit over the tolerance,
and below it the evaluations of the forces; a star marks a ratio outside 0.1 … 10. Exit code 1 where one of our methods with a
parameter `tolerance` has such a ratio at an error above `FLOOR`, below which rounding counts. `epsilon` of ias15 and `step` of
adaptive_leapfrog are defined by their sources: their errors are divided by epsilon^(15/7) and by step².
"""

import argparse
import math
import sys
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parent)]  # so that it also runs from a checkout

from benchmark_adaptive import JUPITER_YEAR, MASS, POSITION, VELOCITY, centred  # noqa: E402
from benchmark_adaptive import G as SUN_G  # noqa: E402
from verdicts import finish  # noqa: E402

ECCENTRICITIES = (0.0, 0.5, 0.9, 0.99)
PLANET = 1e-3
LOOKS = (1, 2, 3, 5, 10)  # orbits
LOW, HIGH = 0.1, 10.0
FLOOR = 2e-11
# Parameter, values, the power of it that the error follows, whether it is called a tolerance.
OURS = {
    "taylor": ("tolerance", 10.0 ** -np.arange(4.0, 14.0), 1.0),
    "adaptive_dop853": ("tolerance", 10.0 ** -np.arange(4.0, 14.0), 1.0),
    "adaptive_bogacki_shampine": ("tolerance", 10.0 ** -np.arange(4.0, 9.0), 1.0),
    "ias15": ("epsilon", 10.0 ** -np.arange(2.0, 7.0), 15 / 7),
    "adaptive_leapfrog": ("step", 10.0 ** -np.arange(1.0, 3.5, 0.5), 2.0),
}
OTHERS = {"scipy dop853": 10.0 ** -np.arange(4.0, 14.0), "heyoka": 10.0 ** -np.arange(4.0, 14.0)}


class Problem:
    """Bodies, the times at which they are compared, their places then, and what an error there is divided by."""

    def __init__(self, name, g, mass, x, v, times, parts, size=None, ends=None):
        """With heyoka's places where none are given."""
        self.name, self.g, self.mass, self.x, self.v = name, g, mass, x, v
        self.times, self.parts = times, parts
        self.size = float(np.sqrt((x**2).sum(1).mean())) if size is None else size
        self.ends = [end for end, _ in self.by_heyoka(np.longdouble, 0.0)] if ends is None else ends

    def error(self, runs):
        """Error per orbit, and evaluations, of (places, evaluations) at all times."""
        errors = [np.linalg.norm((x - end).astype(float), axis=1).max() / self.size for (x, _), end in zip(runs, self.ends)]
        return float(max(error / part for error, part in zip(errors, self.parts))), int(runs[-1][1])

    def by_heyoka(self, kind, tolerance):
        """Its Taylor method; tolerance 0 is its tightest. A step counts as many evaluations as its order."""
        import heyoka

        state = np.concatenate([np.r_[x, v] for x, v in zip(self.x, self.v)]).astype(kind)
        system = heyoka.model.nbody(len(self.mass), masses=list(self.mass), Gconst=self.g)
        run = heyoka.taylor_adaptive(system, state, tol=kind(tolerance), fp_type=kind)
        found, steps = [], 0
        for time in self.times:
            steps += run.propagate_until(kind(time))[3]
            found.append((np.array(run.state).reshape(-1, 6)[:, :3], steps * run.order))
        return found

    def by_scipy(self, tolerance):
        """DOP853 with rtol, and atol a thousandth of it in parts of the size."""
        from scipy.integrate import solve_ivp

        shape, (i, j) = self.x.shape, np.triu_indices(len(self.mass), 1)

        def derivative(_, y):
            x, v = y.reshape(2, *shape)
            d = x[j] - x[i]
            pull = self.g * d / (d * d).sum(1)[:, None] ** 1.5
            a = np.zeros(shape)
            np.add.at(a, i, self.mass[j, None] * pull)
            np.add.at(a, j, -self.mass[i, None] * pull)
            return np.concatenate([v, a]).ravel()

        y, begin, spent, found = np.concatenate([self.x, self.v]).ravel(), 0.0, 0, []
        for time in self.times:
            part = solve_ivp(derivative, (begin, time), y, "DOP853", rtol=tolerance, atol=1e-3 * tolerance * self.size)
            y, begin, spent = part.y[:, -1], time, spent + part.nfev
            found.append((y.reshape(2, *shape)[0].copy(), spent))
        return found


def kepler(eccentricity):
    """Two bodies at the end of the minor axis, towards the pericentre."""
    rate, mass = math.sqrt(1 + PLANET), np.array([1.0, PLANET])
    weight = mass / mass.sum()
    x = np.array([[0, 0, 0], [-eccentricity, -math.sqrt(1 - eccentricity**2), 0]])
    v = np.array([[0, 0, 0], [rate, 0, 0]])
    x, v, period = x - weight @ x, v - weight @ v, 2 * math.pi / rate
    size, parts = float(np.sqrt((x**2).sum(1).mean())), [n * (n + 1) / 2 for n in LOOKS]
    return Problem(f"Kepler {eccentricity}", 1.0, mass, x, v, [n * period for n in LOOKS], parts, size, [x] * len(LOOKS))


def pleiades():
    """Seven stars of masses 1 … 7."""
    x, v, mass = np.zeros((7, 3)), np.zeros((7, 3)), np.arange(1.0, 8.0)
    x[:, 0], x[:, 1] = [3, 3, -1, -3, 2, -2, 2], [3, -3, 2, 0, 0, -4, 4]
    v[5:, 0], v[3:5, 1] = [1.75, -1.5], [-1.25, 1]
    weight = mass / mass.sum()
    return Problem("Pleiades", 1.0, mass, x - weight @ x, v - weight @ v, [3.0], [1])


def planets():
    """The outer solar system."""
    return Problem("planets", SUN_G, MASS, *centred(POSITION, VELOCITY), [46 * JUPITER_YEAR], [46])


def ours(problems, method):
    """{(problem, value): (error, evaluations)}; the problems have the same masses and times, and are replicas of one run."""
    from mpp_taichi import Simulation

    (name, values, _), first = OURS[method], problems[0]
    scene = {
        "particles": [
            {"body": {"mass": float(m), "position": x.tolist(), "velocity": v.tolist()}}
            for m, x, v in zip(first.mass, first.x, first.v)
        ],
        "forces": [{"newtonian_gravity": {"strength": first.g}}],
        "integrator": {method: {"dt": first.times[0], name: float(values[0])}},
    }
    with Simulation(scene, backend="cpu", precision="f64", plan="serial") as run:
        start = run.snapshot()
    starts = [start.moved(position=each.x, velocity=each.v, time=0.0, step=0) for each in problems]
    found = {}
    with Simulation(scene, backend="cpu", precision="f64", replica_starts=starts) as run:
        mark = run.mark()
        for value in values:
            setattr(run.integrator, name, float(value))
            run.return_to(mark)
            run.launcher.prepare(0.0, run.dt)
            looks = [[] for _ in problems]
            for time in first.times:
                run.run(until=time)
                spent = run.integrator.counts(run.state)[:, run.integrator.EVALUATIONS]
                for k, look in enumerate(looks):
                    look.append((run.snapshot(k).position, spent[k]))
            found |= {(each.name, float(value)): each.error(look) for each, look in zip(problems, looks)}
    return found


def show(method, rows, power):
    """Print the table of a method; returns the ratios that are outside the bounds although rounding is far."""
    values = list(dict.fromkeys(value for _, value in rows))
    print(f"\n{method}: error per orbit over the control" + (f"^{power:.3g}" if power != 1 else ""))
    print(f"{'':14}" + "".join(f"{value:9.0e}" for value in values))
    outside = []
    for problem in dict.fromkeys(name for name, _ in rows):
        errors = [rows[problem, value][0] for value in values]
        ratios = [error / value**power for error, value in zip(errors, values)]
        wrong = [not LOW <= ratio <= HIGH for ratio in ratios]
        outside += [ratio for ratio, error, bad in zip(ratios, errors, wrong) if bad and error > FLOOR]
        print(f"{problem:14}" + "".join(f"{ratio:8.2g}{'*' if bad else ' '}" for ratio, bad in zip(ratios, wrong)))
        print(f"{'':14}" + "".join(f"{rows[problem, value][1]:8d} " for value in values), flush=True)
    return outside


def main():
    """Run, print, write; exit code 1 where a ratio is outside the bounds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--methods", nargs="+", default=[*OURS, *OTHERS], choices=[*OURS, *OTHERS])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    from mpp_taichi.device import backends

    backends.start("cpu", "f64", threads=1)
    orbits = [kepler(e) for e in ECCENTRICITIES]
    groups = [orbits, [pleiades()], [planets()]]
    results, verdicts = {}, []
    for method in options.methods:
        rows, power = {}, 1.0
        for group in groups:
            if method in OURS:
                rows |= ours(group, method)
                power = OURS[method][2]
                continue
            for each in group:
                for value in OTHERS[method]:
                    runs = each.by_scipy(value) if method == "scipy dop853" else each.by_heyoka(float, value)
                    rows[each.name, float(value)] = each.error(runs)
        outside = show(method, rows, power)
        if method in OURS and OURS[method][0] == "tolerance":
            verdicts.append((f"{method}: ratios outside 0.1 … 10, at most", len(outside), 0, not outside))
        results[method] = [
            {"problem": name, "control": value, "error": error, "evaluations": spent}
            for (name, value), (error, spent) in rows.items()
        ]
    return finish(verdicts, results, options.json)


if __name__ == "__main__":
    sys.exit(main())
