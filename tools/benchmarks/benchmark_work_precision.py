"""Error against time on three problems: our methods beside REBOUND, SciPy and heyoka.

    python tools/benchmarks/benchmark_work_precision.py [--repeats 5] [--problems figure_eight …] [--json FILE] [--html FILE]
        [--from JSON]

Problems: Kepler's at e = 0.6 over 100 orbits, the figure eight over 20 periods, the outer solar system over 50 orbits of
Jupiter. The error is that of the positions at the end, the largest of a body over the root mean square distance from the
centre of mass, against heyoka in long double at its tightest tolerance; what a looser one makes of it is the error bar. Times
are the processor's, of one thread, of the stepping alone: medians of repeats; all runs of a problem take turns. What takes
milliseconds is run three times in a row, of which the last counts. REBOUND runs leapfrog, WHFast (at its fastest, with and
without a corrector) and IAS15, SciPy DOP853, heyoka its Taylor method. WHFast and wisdom_holman solve Kepler's problem
exactly, and do not know the figure eight, which has no central body. For each decade the fastest run of every contender that
reaches it is compared. `pip install .[bench]` brings them.
With --from the page is drawn again from the numbers of an earlier run.
"""

import argparse
import json
import os
import platform
import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parent)]  # so that it also runs from a checkout

from benchmark_adaptive import JUPITER_YEAR, MASS, POSITION, VELOCITY  # noqa: E402
from benchmark_adaptive import G as SUN_G  # noqa: E402

CENTRAL = ("wisdom_holman", "whfast")  # want a central body
DECADES = range(2, 13)
# Force evaluations of a step; 0: the method chooses its steps. Each run has LADDER times as many steps as the one before.
METHODS = {
    "leapfrog": 1, "pefrl": 4, "srkn6b": 6, "srkn14a": 14, "kahan_li8": 17, "rkn8": 17, "dop853": 12,
    "wisdom_holman": 1, "adaptive_leapfrog": 0, "adaptive_dop853": 0, "ias15": 0, "taylor": 0,
}  # fmt: skip
HALF_DECADES = 10.0 ** -np.arange(3, 16.5, 0.5)
CONTROLS = {
    "adaptive_leapfrog": ("step", 0.1 / np.sqrt(10.0) ** np.arange(7)),
    "adaptive_dop853": ("tolerance", 10.0 ** -np.arange(3.0, 15.0)),
    "ias15": ("epsilon", 10.0 ** -np.arange(3.0, 10.0, 0.5)),
    "taylor": ("tolerance", HALF_DECADES),
}
WARMED = 0.1  # seconds; what takes longer is warm most of the time
LADDER = 10.0 ** (1 / 6)
FINEST = 3e6  # evaluations of the force, of the dearest run
SHOWN = ("best of ours", "rebound leapfrog", "rebound whfast", "rebound ias15", "scipy dop853", "heyoka")
DRAWN = (
    "our front",
    "rebound leapfrog",
    "rebound whfast",
    "rebound ias15",
    "scipy dop853",
    "heyoka",
    "rebound whfast corrected",
)
PAGE_STYLE = (
    "body { max-width: none; margin: 1rem 0; display: flex; flex-wrap: wrap } section { width: 30rem; margin: 0 .6rem }"
    "h2 { font-size: 1rem; margin: 0 } .legend { font-size: .8rem }"
)


def kepler():
    """Two bodies from the greatest distance."""
    e, mass = 0.6, np.array([1.0, 1e-3])
    speed = np.sqrt(mass.sum() * (1 - e) / (1 + e))
    x, v = np.array([[0, 0, 0], [1 + e, 0, 0]], float), np.array([[0, 0, 0], [0, speed, 0]], float)
    return "Kepler, e = 0.6, 100 orbits", 1.0, mass, x, v, 100 * 2 * np.pi / np.sqrt(mass.sum()), 100


def figure_eight():
    """Chenciner & Montgomery's."""
    p, w = np.array([0.97000436, -0.24308753, 0]), np.array([-0.93240737, -0.86473146, 0])
    x, v = np.array([p, -p, np.zeros(3)]), np.array([-w / 2, -w / 2, w])
    return "figure eight, 20 periods", 1.0, np.ones(3), x, v, 20 * 6.32591398, 20


def outer_solar_system():
    """Sun, giants and Pluto."""
    return "outer solar system, 50 orbits of Jupiter", SUN_G, MASS, POSITION, VELOCITY, 50 * JUPITER_YEAR, 50


PROBLEMS = {"kepler": kepler, "figure_eight": figure_eight, "outer_solar_system": outer_solar_system}


class Problem:
    """Bodies about their centre of mass, a span, and where they are at its end."""

    def __init__(self, make):
        """With its reference."""
        self.name, self.g, self.mass, x, v, self.span, self.periods = make()
        weight = self.mass / self.mass.sum()
        self.x, self.v = x - weight @ x, v - weight @ v
        self.size = float(np.sqrt((self.x**2).sum(1).mean()))
        self.end, coarser = self._heyoka(np.longdouble, 0.0), self._heyoka(np.longdouble, 1e-17)
        self.bar = float(self.error(coarser))

    def error(self, positions):
        """Largest of a body, over the size of the system."""
        return np.linalg.norm((positions - self.end).astype(float), axis=1).max() / self.size

    def _heyoka(self, kind, tolerance):
        run = self.heyoka(kind, tolerance)
        run.propagate_until(kind(self.span))
        return np.array(run.state).reshape(-1, 6)[:, :3]

    def heyoka(self, kind, tolerance):
        """Its integrator; tolerance 0 is its tightest."""
        import heyoka

        state = np.concatenate([np.r_[x, v] for x, v in zip(self.x, self.v)]).astype(kind)
        system = heyoka.model.nbody(len(self.mass), masses=list(self.mass), Gconst=self.g)
        return heyoka.taylor_adaptive(system, state, tol=kind(tolerance), fp_type=kind)


def warm(once):
    """Seconds of the third time in a row where it takes milliseconds: caches and predictors are cold after compiling."""
    seconds = once()
    for _ in range(2):
        seconds = once() if seconds < WARMED else seconds
    return seconds


class Ours:
    """One of our methods on a problem, compiled when it is first run; the step and the tolerance are arguments of kernels."""

    def __init__(self, problem, method):
        """Not compiled yet."""
        self.problem, self.method, self.simulation = problem, method, None

    def _compile(self, setting):
        from mpp_taichi import Simulation

        bodies = zip(self.problem.mass, self.problem.x, self.problem.v)
        scene = {
            "particles": [{"body": {"mass": float(m), "position": x.tolist(), "velocity": v.tolist()}} for m, x, v in bodies],
            "forces": [{"newtonian_gravity": {"strength": self.problem.g}}],
            "integrator": {self.method: {"dt": self.problem.span / 2, **setting}},
        }
        self.simulation = Simulation(scene, backend="cpu", precision="f64", plan="serial")
        self._once(1, setting)

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
            self._compile(setting)
        seconds = warm(lambda: self._once(steps, setting))
        return self.simulation.state.read()[0], seconds


def ours(problem, method):
    """Runs of one of our methods: (label, run) with run() → positions, seconds."""
    compiled, evaluations = Ours(problem, method), METHODS[method]
    if evaluations:
        count, settings = 20.0 * problem.periods / evaluations * (1 if evaluations > 1 or method in CENTRAL else 3), []
        while count * evaluations < FINEST:
            settings.append((problem.span / round(count), round(count), {}))
            count *= LADDER
    else:
        name, values = CONTROLS[method]
        settings = [(value, 2, {name: float(value)}) for value in values]
    return [
        (f"{method} {value:.3g}", lambda steps=steps, setting=setting: compiled.run(steps, setting))
        for value, steps, setting in settings
    ]


def rebound_runs(problem, name):
    """Runs of one of REBOUND's integrators."""
    import rebound

    if name == "ias15":
        settings = [(epsilon, 0) for epsilon in CONTROLS["ias15"][1]]
    else:
        steps = [problem.span / (problem.periods * count) for count in 20 * LADDER ** np.arange(22)]
        settings = [(step, corrector) for corrector in ((0, 11) if name == "whfast" else (0,)) for step in steps]

    def runner(setting, corrector):
        def run():
            s = rebound.Simulation()
            s.G, s.integrator = problem.g, name
            for m, x, v in zip(problem.mass, problem.x, problem.v):
                s.add(m=m, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])
            steps = round(problem.span / setting)
            began = time.process_time()
            if name == "ias15":
                s.integrator.epsilon = setting
                s.integrate(problem.span)
            else:
                s.dt = problem.span / steps
                if name == "whfast":
                    s.integrator.safe_mode, s.integrator.corrector = 0, corrector
                s.steps(steps)  # `integrate` may take one more, where the sum of the steps is rounded down
                s.synchronize()
            seconds = time.process_time() - began
            return np.array([p.xyz for p in s.particles]), seconds

        return run

    return [(f"{name} {value:.3g}" + " corrected" * (corrector > 0), runner(value, corrector)) for value, corrector in settings]


def scipy_runs(problem):
    """DOP853 with tolerances."""
    from scipy.integrate import solve_ivp

    n, shape = len(problem.mass), problem.x.shape
    i, j = np.triu_indices(n, 1)

    def derivative(_, y):
        x, v = y.reshape(2, *shape)
        d = x[j] - x[i]
        pull = problem.g * d / (d * d).sum(1)[:, None] ** 1.5
        a = np.zeros(shape)
        np.add.at(a, i, problem.mass[j, None] * pull)
        np.add.at(a, j, -problem.mass[i, None] * pull)
        return np.concatenate([v, a]).ravel()

    def runner(tolerance):
        def run():
            began = time.process_time()
            found = solve_ivp(derivative, (0, problem.span), np.concatenate([problem.x, problem.v]).ravel(), "DOP853",
                              t_eval=[problem.span], rtol=tolerance, atol=tolerance * 1e-3 * problem.size)  # fmt: skip
            return found.y[:, -1].reshape(2, *shape)[0], time.process_time() - began

        return run

    return [(f"dop853 {tolerance:g}", runner(tolerance)) for tolerance in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 3e-14)]


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
            return np.array(integrator.state).reshape(-1, 6)[:, :3], seconds

        return run

    return [(f"taylor {tolerance:g}", runner(tolerance)) for tolerance in HALF_DECADES]


def measure(problem, repeats):
    """{contender: [(label, error, seconds)]}."""

    def suits(name):
        return name not in CENTRAL or "eight" not in problem.name

    runs = {method: ours(problem, method) for method in METHODS if suits(method)}
    runs |= {f"rebound {name}": rebound_runs(problem, name) for name in ("leapfrog", "whfast", "ias15") if suits(name)}
    runs |= {"scipy dop853": scipy_runs(problem), "heyoka": heyoka_runs(problem)}
    found = {}
    for turn in range(repeats):
        for contender, entries in runs.items():
            for label, run in entries:
                row = found.setdefault((contender, label), {"seconds": []})
                if turn and min(row["seconds"]) > 1.0:
                    continue  # what takes seconds varies little
                positions, seconds = run()
                row["error"] = max(float(problem.error(positions)), problem.bar)
                row["seconds"].append(seconds)
    table = {}
    for (contender, label), row in found.items():
        table.setdefault(contender, []).append((label, row["error"], float(np.median(row["seconds"]))))
    return table


def fastest(rows, error):
    """The fastest run at most so wrong, or None."""
    return min((row for row in rows if row[1] <= error), key=lambda row: row[2], default=None)


def show(problem, table):
    """The table of decades; returns its rows."""
    mine = [row for method in METHODS for row in table.get(method, [])]
    groups = {"best of ours": mine, **{name: table[name] for name in SHOWN[1:] if name in table}}
    print(f"\n{problem.name}: ms to an error of the position (reference good to {problem.bar:.1e})")
    print(f"{'error':>8}" + "".join(f"{name:>18}" for name in groups) + "   which of ours")
    rows = []
    for k in DECADES:
        best = {name: fastest(rows_, 10.0**-k) for name, rows_ in groups.items()}
        cells = "".join(f"{1e3 * row[2]:18.3f}" if row else f"{'-':>18}" for row in best.values())
        reached = [row[2] for name, row in best.items() if row and name != "best of ours"]
        own = best["best of ours"]
        on_front = own is not None and (not reached or own[2] <= min(reached))
        print(f"{10.0**-k:8.0e}{cells}   {own[0] if own else '-'}{'  on the front' if on_front else ''}", flush=True)
        rows.append({"error": 10.0**-k, "on_front": bool(on_front), "fastest": best})
    return rows


def page(results):
    """One HTML page of plots, by the report's own drawing."""
    from mpp_taichi.accuracy.report import style_sheet
    from mpp_taichi.accuracy.svg import Plot, PlotMark, Series, draw, marker

    parts = [
        f"<!doctype html><meta charset='utf-8'><title>Work and precision</title><style>{style_sheet()}{PAGE_STYLE}</style>"
    ]
    for name, table in results.items():
        curves = {"our front": front(row for method in METHODS for row in table.get(method, []))}
        for other in SHOWN[1:]:
            for kind in ("", " corrected"):
                if rows := [row for row in table.get(other, []) if row[0].endswith(" corrected") == bool(kind)]:
                    curves[other + kind] = rows
        kinds = {other: DRAWN.index(other) for other in curves}
        series = [
            Series(
                other,
                kinds[other],
                [PlotMark(row[2], row[1], f"{row[0]}: {row[1]:.1e}, {1e3 * row[2]:.3g} ms") for row in rows],
            )
            for other, rows in curves.items()
        ]
        keys = "".join(f'<li><svg viewBox="0 0 26 14">{marker(k, 13, 7)}</svg>{other}</li>' for other, k in kinds.items())
        plot = Plot(name, "time of the stepping [s]", "error of position at the end", series)
        parts.append(f"<section><h2>{name}</h2>{draw(plot)}<ul class='legend'>{keys}</ul></section>")
    return "\n".join(parts)


def front(rows):
    """Those than which none is both faster and better, from the fastest on."""
    best, least = [], np.inf
    for row in sorted(rows, key=lambda row: row[2]):
        if row[1] < least:
            least = row[1]
            best.append(row)
    return best


def main():
    """Run, print, write; exit code 1 when the bar is not met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--problems", nargs="+", default=list(PROBLEMS), choices=list(PROBLEMS))
    parser.add_argument("--json", type=Path)
    parser.add_argument("--html", type=Path)
    parser.add_argument("--from", dest="earlier", type=Path)
    options = parser.parse_args()
    if options.earlier:
        options.html.write_text(page(json.loads(options.earlier.read_text("utf-8"))["results"]), encoding="utf-8")
        return 0
    from mpp_taichi.device import backends

    backends.start("cpu", "f64", threads=1)
    results, decades = {}, {}
    for name in options.problems:
        problem = Problem(PROBLEMS[name])
        results[problem.name] = measure(problem, options.repeats)
        decades[problem.name] = show(problem, results[problem.name])
    whole = [name for name, rows in decades.items() if all(row["on_front"] for row in rows)]
    print(f"\n{'ok  ' if len(whole) >= 2 else 'FAIL'} on the front at every decade on {len(whole)} of 3 problems, at least 2")
    if options.json:
        machine = {
            "processor": platform.processor() or platform.machine(),
            "cores": os.cpu_count(),
            "system": platform.platform(),
        }
        options.json.write_text(
            json.dumps({"machine": machine, "results": results, "decades": decades}, indent=1), encoding="utf-8"
        )
    if options.html:
        options.html.write_text(page(results), encoding="utf-8")
    return 0 if len(whole) >= 2 else 1


if __name__ == "__main__":
    sys.exit(main())
