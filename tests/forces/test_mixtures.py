"""Named forces that stand several times in a scene, with numbers of their own for each pair of groups and for each group."""

import numpy as np
import pytest

from mpp_taichi import SceneError, Simulation

DEPTH = {"AA": 1.0, "AB": 1.5, "BB": 0.5}  # of W. Kob and H. C. Andersen, Phys. Rev. E 51 (1995) 4626
LENGTH = {"AA": 1.0, "AB": 0.8, "BB": 0.88}
CUT = 2.5


def mixture(count, *, periodic):
    """Two kinds of atoms on a slightly disturbed lattice, a fifth of them of the kind B."""
    edge = 1.1 * count
    layers = [round(0.8 * count), count - round(0.8 * count)]
    particles, first = [], 0
    for name, depth in zip("AB", layers, strict=True):
        low, high = 1.1 * (first + 0.5), 1.1 * (first + depth - 0.5)
        corners = {"lower": [0.55, 0.55, low], "upper": [edge - 0.55, edge - 0.55, high]}
        lattice = {"name": name, "shape": [count, count, depth], "scatter": [0.1] * 3, **corners}
        particles.append({"lattice": lattice})
        first += depth
    forces = [
        {
            "lennard_jones": {
                "name": key,
                "between": list(key),
                "strength": DEPTH[key],
                "length": LENGTH[key],
                "cutoff": CUT * LENGTH[key],
            }
        }
        for key in DEPTH
    ]
    walls = [{"periodic_box": {"lower": [0, 0, 0], "upper": [edge] * 3}}] if periodic else []
    scene = {"particles": particles, "forces": forces, "walls": walls, "integrator": {"leapfrog": {"dt": 1e-3}}}
    return scene, edge, layers


def sums(position, layers, edge, periodic):
    """Accelerations and the energy, pair by pair."""
    per_layer = len(position) // sum(layers)
    kind = np.repeat([0, 1], [layers[0] * per_layer, layers[1] * per_layer])
    acceleration, energy = np.zeros_like(position), 0.0
    for i in range(len(position)):
        d = position - position[i]
        if periodic:
            d -= edge * np.round(d / edge)
        r = np.linalg.norm(d, axis=1)
        for key, (depth, length) in {key: (DEPTH[key], LENGTH[key]) for key in DEPTH}.items():
            other = key.replace("AB"[kind[i]], "", 1)
            if "AB"[kind[i]] not in key:
                continue
            with np.errstate(divide="ignore", invalid="ignore"):
                u = (length / r) ** 6
                near = (kind == "AB".index(other)) & (r > 0.0) & (r < CUT * length)
                shift = CUT**-12 - CUT**-6
                energy += 0.5 * np.where(near, 4.0 * depth * (u * u - u - shift), 0.0).sum()
                pull = np.where(near, -24.0 * depth * (2.0 * u * u - u) / r**2, 0.0)
            acceleration[i] += np.where(near[:, None], pull[:, None] * d, 0.0).sum(axis=0)
    return acceleration, energy


@pytest.mark.parametrize(("count", "periodic"), [(5, False), (10, True)], ids=["all pairs", "lists of neighbours"])
def test_each_pair_of_groups_has_its_own_numbers(count, periodic):
    scene, edge, layers = mixture(count, periodic=periodic)
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        assert simulation.phase.total_force.by_lists == periodic
        found = simulation.accelerations()
        potential = simulation.diagnostics()["potential_energy"]
        wanted, energy = sums(simulation.snapshot().position, layers, edge, periodic)
    scale = np.abs(wanted).max()
    # A sum of some 100 terms, each rounded a few times.
    assert np.abs(found - wanted).max() < 1000 * np.finfo(float).eps * scale
    assert potential == pytest.approx(energy, rel=1e-12)


def test_two_groups_may_feel_two_traps():
    bodies = [{"body": {"name": name, "mass": 1.0, "position": [1.0, 0, 0]}} for name in ("near", "far")]
    bodies[1]["body"]["position"] = [3.0, 0, 0]
    traps = [
        {"harmonic_trap": {"name": "soft", "frequencies": [1.0, 1.0, 1.0], "on": "near"}},
        {"harmonic_trap": {"name": "hard", "frequencies": [2.0, 1.0, 1.0], "on": "far"}},
    ]
    scene = {"particles": bodies, "forces": traps, "integrator": {"leapfrog": {"dt": 1e-3}}}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        assert simulation.accelerations()[:, 0] == pytest.approx([-1.0, -12.0])


def test_a_slider_moves_one_of_several():
    scene, _, _ = mixture(3, periodic=False)
    scene["sliders"] = [{"set": "forces[1].lennard_jones.strength", "from": 0.1, "to": 3.0}]
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        before = simulation.accelerations()
        simulation.set("forces[1].lennard_jones.strength", 3.0)
        twice = simulation.accelerations()
    alone, _, _ = mixture(3, periodic=False)
    alone["forces"] = [alone["forces"][1]]
    with Simulation(alone, backend="cpu", precision="f64") as simulation:
        extra = simulation.accelerations()
    assert np.abs(twice - before - extra).max() < 1e-11 * np.abs(twice).max()


def test_a_second_force_of_one_name_needs_a_name():
    scene, _, _ = mixture(3, periodic=False)
    for entry in scene["forces"]:
        del entry["lennard_jones"]["name"]
    with pytest.raises(SceneError, match="lennard_jones is in the list already, allowed: once; give each a name: of its own"):
        Simulation(scene, backend="cpu")
