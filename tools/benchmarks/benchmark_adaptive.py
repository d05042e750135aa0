"""IAS15 beside REBOUND's on the outer solar system: time, and how the error of the energy grows.

    python tools/benchmarks/benchmark_adaptive.py [--years 2000] [--repeats 7] [--seconds 60] [--replicas 16] [--json FILE]

Sun, four giant planets and Pluto from their places of 5 September 1994 (Hairer, Lubich & Wanner, Geometric Numerical
Integration (2006) table I.2.2), masses of the sun, au and days. Times are those of one thread each, interleaved, by the
processor's clock, without compilation. Growth: the rms over slightly different systems of the relative error of the energy,
summed in long double, at times that double, for as many seconds; by Brouwer's law it grows with the root of the number of
steps (slope 0.5). A bar is said to hold or not.
"""

import argparse
import json
import os
import platform
import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2])]  # so that it also runs from a checkout

G = 2.95912208286e-4  # au³ / (mass of the sun · day²)
JUPITER_YEAR = 4332.59  # days
MASS = np.array([1.00000597682, 9.54786104043e-4, 2.85583733151e-4, 4.37273164546e-5, 5.17759138449e-5, 1 / 1.3e8])
POSITION = np.array([
    [0.0, 0.0, 0.0], [-3.5023653, -3.8169847, -1.5507963], [9.0755314, -3.0458353, -1.6483708],
    [8.3101420, -16.2901086, -7.2521278], [11.4707666, -25.7294829, -10.8169456], [-15.5387357, -25.2225594, -3.1902382],
])  # fmt: skip
VELOCITY = np.array([
    [0.0, 0.0, 0.0], [0.00565429, -0.00412490, -0.00190589], [0.00168318, 0.00483525, 0.00192462],
    [0.00354178, 0.00137102, 0.00055029], [0.00288930, 0.00114527, 0.00039677], [0.00276725, -0.00170702, -0.00136504],
])  # fmt: skip
BARS = {"time over REBOUND's": 2.0, "energy error over 1e-15 √steps": 1.0, "slope": (0.35, 0.65)}


def energy(position, velocity):
    """In long double."""
    x, v, m = (a.astype(np.longdouble) for a in (position, velocity, MASS))
    total = 0.5 * (m[:, None] * v**2).sum()
    for i in range(len(m)):
        for j in range(i):
            total -= G * m[i] * m[j] / np.sqrt(((x[i] - x[j]) ** 2).sum())
    return total


def centred(position, velocity):
    """With the centre of mass at rest at the origin."""
    weight = MASS / MASS.sum()
    return position - weight @ position, velocity - weight @ velocity


def scene(looks):
    """Of ours."""
    x, v = centred(POSITION, VELOCITY)
    return {
        "title": "Outer solar system",
        "particles": [
            {"body": {"mass": float(m), "position": p.tolist(), "velocity": w.tolist()}} for m, p, w in zip(MASS, x, v)
        ],
        "forces": [{"newtonian_gravity": {"strength": G}}],
        "integrator": {"ias15": {"dt": looks}},
    }


def rebound_system(velocity_factor=1.0):
    """Of REBOUND."""
    import rebound

    simulation = rebound.Simulation()
    simulation.integrator, simulation.G = "ias15", G
    x, v = centred(POSITION, VELOCITY)
    for m, p, w in zip(MASS, x, v * velocity_factor):
        simulation.add(m=m, x=p[0], y=p[1], z=p[2], vx=w[0], vy=w[1], vz=w[2])
    return simulation


def rebound_energy(simulation):
    """In long double, too."""
    return energy(np.array([p.xyz for p in simulation.particles]), np.array([p.vxyz for p in simulation.particles]))


def measure_time(span, repeats):
    """Seconds of the processor for so many days, of both."""
    from mpp_taichi import Simulation

    times = {"ours": [], "rebound": []}
    other = rebound_system()
    with Simulation(scene(span), backend="cpu", precision="f64") as run:
        run.run(steps=1)  # compiles
        steps = run.integrator.counts(run.state)[0, run.integrator.STEPS]
        other.integrate(span)
        before = other.steps_done
        for k in range(repeats):
            began = time.process_time()
            run.run(steps=1)
            times["ours"].append(time.process_time() - began)
            began = time.process_time()
            other.integrate((k + 2) * span, exact_finish_time=0)
            times["rebound"].append(time.process_time() - began)
        done = run.integrator.counts(run.state)[0, run.integrator.STEPS] - steps
    return times, {"ours": int(done) / repeats, "rebound": (other.steps_done - before) / repeats}


def measure_growth(seconds, replicas):
    """Times, steps and rms energy errors, of both, until the seconds are used."""
    from mpp_taichi import Simulation

    with Simulation(scene(JUPITER_YEAR), backend="cpu", precision="f64") as run:
        start = run.snapshot()
    factors = 1 + 1e-6 * np.arange(replicas)
    starts = [start.moved(position=start.position, velocity=start.velocity * f, time=0.0, step=0) for f in factors]
    others = [rebound_system(f) for f in factors]
    rows = []
    with Simulation(scene(JUPITER_YEAR), backend="cpu", precision="f64", replica_starts=starts) as run:

        def errors_now(first):
            now = [run.snapshot(k) for k in range(replicas)]
            return np.array([energy(s.position, s.velocity) / e - 1 for s, e in zip(now, first)])

        first = [energy(s.position, s.velocity) for s in starts]
        other_first = [rebound_energy(s) for s in others]
        years, began = 8, time.perf_counter()
        while time.perf_counter() - began < seconds / 2:
            run.run(until=years * JUPITER_YEAR)
            for simulation in others:
                simulation.integrate(years * JUPITER_YEAR, exact_finish_time=0)
            other_errors = [rebound_energy(s) / e - 1 for s, e in zip(others, other_first)]
            rows.append({
                "orbits": years,
                "steps": float(run.integrator.counts(run.state)[:, run.integrator.STEPS].mean()),
                "ours": float(np.sqrt(np.mean(errors_now(first).astype(float) ** 2))),
                "rebound_steps": float(np.mean([s.steps_done for s in others])),
                "rebound": float(np.sqrt(np.mean(np.array(other_errors, float) ** 2))),
            })  # fmt: skip
            print(f"{years:10,d} orbits{rows[-1]['steps']:14,.0f} steps{rows[-1]['ours']:11.2e}"
                  f"{rows[-1]['rebound']:16.2e}", flush=True)  # fmt: skip
            years *= 2
    return rows


def slope(rows, name):
    """Of the logarithm of the error over that of the time."""
    return float(np.polyfit(np.log([r["orbits"] for r in rows]), np.log([r[name] for r in rows]), 1)[0])


def main():
    """Run, print, write; exit code 1 when a bar is not met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--years", type=float, default=2000)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--replicas", type=int, default=16)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    times, steps = measure_time(options.years * 365.25, options.repeats)
    ratio = float(np.median(np.divide(times["ours"], times["rebound"])))
    for name, values in times.items():
        print(f"{name:10}{1e3 * np.median(values):10.2f} ms for {options.years:g} years, {steps[name]:,.0f} steps")
    print(f"\n{'rms error of the energy':>42}: ours, REBOUND's")
    rows = measure_growth(options.seconds, options.replicas)
    slopes = {name: slope(rows, name) for name in ("ours", "rebound")}
    most = max(r["ours"] / (1e-15 * np.sqrt(r["steps"])) for r in rows)
    low, high = BARS["slope"]
    verdicts = [
        ("time over REBOUND's, at most 2", ratio, ratio <= BARS["time over REBOUND's"]),
        ("energy error over 1e-15 √steps, at most 1", most, most <= BARS["energy error over 1e-15 √steps"]),
        ("slope of the growth, 0.5 ± 0.15", slopes["ours"], low <= slopes["ours"] <= high),
    ]
    print(f"\nslope of REBOUND's growth: {slopes['rebound']:.2f}")
    for text, value, held in verdicts:
        print(f"{'ok  ' if held else 'FAIL'} {text}: {value:.3g}")
    if options.json:
        machine = {
            "processor": platform.processor() or platform.machine(),
            "cores": os.cpu_count(),
            "system": platform.platform(),
        }
        bars = [{"bar": text, "value": value, "held": bool(held)} for text, value, held in verdicts]
        content = {"machine": machine, "times": times, "steps": steps, "growth": rows, "slopes": slopes, "bars": bars}
        options.json.write_text(json.dumps(content, indent=1), encoding="utf-8")
    return 0 if all(held for *_, held in verdicts) else 1


if __name__ == "__main__":
    sys.exit(main())
