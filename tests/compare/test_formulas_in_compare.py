"""Formulas in `compare`: the reference, its bounds of rounding errors, the OpenCL kernels, and errors that must be noticed."""

import numpy as np
import pytest

from mpp_taichi.compare.certificate import ROUNDING, SMALLEST
from mpp_taichi.compare.numpy_pairs import ROUNDINGS, Limits
from mpp_taichi.compare.numpy_reference import NumpyForces, bodies, kept, refusal
from mpp_taichi.compare.opencl_contender import OpenclContender
from mpp_taichi.compare.taichi_contender import TaichiContender
from mpp_taichi.errors import BackendError
from mpp_taichi.scene.formulas.array_steps import ArrayArithmetic
from mpp_taichi.scene.formulas.pair_law import pair_law
from mpp_taichi.scene.formulas.rounding_steps import Rounded, RoundingArithmetic
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

PLACES = np.random.default_rng(5).uniform(-2.0, 2.0, (60, 3))
SPEEDS = np.random.default_rng(6).uniform(-1.0, 1.0, (60, 3))
LAWS = {
    "lennard_jones": {"lennard_jones": {"strength": 0.7, "length": 0.3}},
    "morse": {"morse": {"strength": 0.7, "steepness": 2.0, "length": 0.9}},
    "charges": {"pair": {"potential": "0.3*q1*q2*exp(-r/2)*(1 + sin(r)^2)/r^1.5"}},
    "soft": {"weeks_chandler_andersen": {"strength": 0.5, "length": 1.1}},
    "roots": {"pair": {"potential": "m1*m2*(sqrt(r^2 + 0.3) - tanh(r)^2 + abs(r - 1)^3)", "softening": 0.1}},
}
FIELDS = {
    "field": {"external": {"potential": "m*x^2 + q*exp(-y^2)*z"}},
    "drag": {"external": {"acceleration": ["-0.1*v*vx", "-0.1*v*vy + sin(x)", "-z/m"]}},
}


def scene_of(force, **more):
    particles = [
        {"body": {"position": place.tolist(), "velocity": speed.tolist(), "mass": 1 + k % 3, "charge": (-1.0) ** k}}
        for k, (place, speed) in enumerate(zip(PLACES, SPEEDS))
    ]
    forces = force if isinstance(force, list) else [force]
    return load_scene({"particles": particles, "forces": forces, "integrator": {"leapfrog": {"dt": 1e-3}}, **more})


def ratio_to_allowance(spec, contender_of, precision, monkeypatch=None):
    """The largest error of an acceleration, as a share of what rounding may cause."""
    start = assemble(spec)
    contender = contender_of(spec, start, precision)
    place, speed, found = contender.accelerations_at(PLACES, SPEEDS)
    contender.close()
    reference = NumpyForces(spec, bodies(start, 3, [precision]))
    place, speed = kept(place, precision)[None], kept(speed, precision)[None]
    rows = np.arange(len(PLACES))
    exact = reference.acceleration(place, speed)[0]
    unit = ROUNDING[precision] + ROUNDING["f64"]
    size, more = (each[0] for each in reference.magnitude(place, speed, rows, Limits(unit, SMALLEST[precision])))
    allowed = (ROUNDINGS + reference.most_terms()) * unit * size + more
    return float(np.max(np.abs(np.pad(found, ((0, 0), (0, 3 - found.shape[1]))) - exact) / allowed))


def taichi(spec, start, precision):
    return TaichiContender(spec, start, "cpu", precision)


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("law", [*LAWS, *FIELDS])
@pytest.mark.sampled(3)
def test_kernels_agree_with_the_reference_to_rounding(law, precision):
    ratio = ratio_to_allowance(scene_of((LAWS | FIELDS)[law]), taichi, precision)
    assert ratio < 1.0
    assert ratio > 1e-6 or precision == "f64"  # the allowance is no licence; in f64 both may have the same bits


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.sampled(3)
def test_opencl_evaluates_the_same_formula(opencl, law, precision):
    assert ratio_to_allowance(scene_of(LAWS[law]), OpenclContender, precision) < 1.0


@pytest.mark.sampled(2)
@pytest.mark.parametrize("variant", ["naive", "tiled"])
def test_the_kernels_for_gpus_evaluate_formulas_too(opencl, variant):
    def contender(spec, start, precision):
        return OpenclContender(spec, start, precision, variant=variant)

    assert ratio_to_allowance(scene_of(LAWS["lennard_jones"]), contender, "f64") < 1.0


@pytest.mark.parametrize("fault", ["a factor", "a power", "the sign"])
def test_a_wrong_formula_is_far_beyond_what_rounding_allows(fault, monkeypatch):
    wrong = {"a factor": "1.0001*0.7*log(r)", "a power": "0.7*log(r) + 1e-4*r", "the sign": "-0.7*log(r)"}[fault]
    spec = scene_of({"pair": {"potential": "0.7*log(r)"}})

    def other(_, start, precision):
        return TaichiContender(scene_of({"pair": {"potential": wrong}}), start, "cpu", precision)

    assert ratio_to_allowance(spec, other, "f64") > 1e6
    assert ratio_to_allowance(spec, other, "f32") > 1.0


@pytest.mark.parametrize(
    "text",
    [
        "4*((0.3/r)^12 - (0.3/r)^6)",
        "(r - 1)^7",
        "exp(-3*r)*sin(9*r)",
        "log(r)^2/r",
        "(1 + r)^0.3 - r^2.5",
        "1/(1.001 - cos(r))",
    ],
)
def test_the_running_error_analysis_bounds_the_errors_in_f32(text):
    """Of 2,000 distances: no error beyond the bound, and the bound is less than a thousand times the typical error."""
    law = pair_law(text, (), ())
    distance = np.linspace(0.2, 3.0, 2000)
    inverse = (1.0 / distance).astype(np.float32)
    exact = law.shape.run(ArrayArithmetic, {"u": inverse.astype(float)}, inverse.astype(float))[0]
    found = law.shape.run(ArrayArithmetic, {"u": inverse}, inverse)[0].astype(float)
    bound = law.shape.run(RoundingArithmetic, {"u": Rounded(inverse.astype(float), 0.0)}, 1.0)[0].error * 2.0**-24
    error = np.abs(found - exact)
    assert np.all(error <= bound)
    assert np.median(bound) < 1000 * np.median(error)


BONDS = {
    "morse": {"bond": {"potential": "D*(1 - exp(-a*(l - l0)))^2", "parameters": {"D": 5, "a": 2, "l0": 1}}},
    "stiffening": {"bond": {"potential": "k*(l - rest)^4 + sqrt(l^2 + 1)", "parameters": {"k": 0.7}}},
    "of some": {"bond": {"potential": "2*log(l)", "of": "chain"}},
}


def bonded(force, **more):
    """Sixty particles, of which all neighbours in the list are linked, and half of them are a group."""
    particles = [
        {"lattice": {"name": "chain", "shape": [30], "lower": [0, 0, 0], "upper": [3, 0, 0], "scatter": [0.3] * 3}},
        {
            "lattice": {
                "name": "other",
                "shape": [30],
                "lower": [0, 1, 0],
                "upper": [3, 1, 0],
                "mass": 2.0,
                "scatter": [0.3] * 3,
            }
        },
    ]
    springs = [{"lattice_links": {"of": each, "stiffness": 1.5, "damping": 0.1}} for each in ("chain", "other")]
    springs.append({"link": {"between": ["chain[0]", "other[0]"], "stiffness": 2.0, "rest_length": 0.4}})
    return load_scene(
        {"particles": particles, "springs": springs, "forces": [force], "integrator": {"leapfrog": {"dt": 1e-3}}} | more
    )


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("law", BONDS)
def test_bonds_agree_with_the_reference_to_rounding(law, precision):
    ratio = ratio_to_allowance(bonded(BONDS[law]), taichi, precision)
    assert ratio < 1.0
    assert ratio > 1e-6 or precision == "f64"


@pytest.mark.parametrize("law", BONDS)
def test_an_error_of_a_bond_is_noticed(monkeypatch, law):
    from mpp_taichi.forces._formula_bond import FormulaBond

    right = FormulaBond.pull
    monkeypatch.setattr(FormulaBond, "pull", lambda *given: right(*given) * (1.0 + 1e-4))
    assert ratio_to_allowance(bonded(BONDS[law]), taichi, "f64") > 100.0


@pytest.mark.parametrize("law", BONDS)
def test_the_energy_of_a_bond_is_that_of_its_force(law):
    spec = bonded(BONDS[law])
    start = assemble(spec)
    reference, step = NumpyForces(spec, bodies(start, 3, ["f64"])), 1e-5
    still = np.zeros((1, 60, 3))
    force = reference.acceleration(start.position[None], still)[0] * start.mass[:, None]
    moved = np.random.default_rng(3).normal(size=(60, 3))
    sides = [reference.energy((start.position + sign * step * moved)[None], still)[0, 1] for sign in (-1.0, 1.0)]
    # A difference quotient: off by its third derivative times 1e-10, and by the rounding of the energies over the step.
    assert (sides[0] - sides[1]) / (2.0 * step) == pytest.approx(np.sum(force * moved), rel=1e-6)


def test_energies_of_the_reference_are_those_of_known_forces():
    known = scene_of([{"newtonian_gravity": {"strength": 2.5, "softening": 0.05}}, {"coulomb": {"coulomb_constant": 0.5}}])
    pairs = [
        {"pair": {"name": "pull", "potential": "-2.5*m1*m2/r", "softening": 0.05}},
        {"pair": {"name": "charges", "potential": "0.5*q1*q2/r"}},
    ]
    energies = []
    for spec in (known, scene_of(pairs)):
        start = assemble(spec)
        energies.append(NumpyForces(spec, bodies(start, 3, ["f64"])).energy(PLACES[None], SPEEDS[None]))
    np.testing.assert_allclose(energies[1], energies[0], rtol=1e-13)


def test_what_the_reference_lacks_is_named():
    assert refusal(scene_of({"pair": {"potential": "R1*R2/r"}})) == "the NumPy reference has no pair"
    assert refusal(scene_of({"external": {"potential": "x*cos(t)"}})) == "the NumPy reference has no external"
    assert refusal(scene_of(LAWS["morse"])) is None
    assert refusal(bonded(BONDS["morse"])) is None


def test_numbers_beyond_a_precision_are_refused(opencl):
    spec = scene_of({"pair": {"potential": "1e200/r"}})
    with pytest.raises(BackendError, match="no OpenCL kernel for pair: .* is no number of f32"):
        OpenclContender(spec, assemble(spec), "f32")
