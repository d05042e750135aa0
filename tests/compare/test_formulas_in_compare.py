"""Formulas in `compare`: the reference, its bounds of rounding errors, the OpenCL kernels, and errors that must be noticed."""

import itertools

import numpy as np
import pytest
from opencl_models import change_kernel

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

PLACE_FIELDS = {
    "field": FIELDS["field"],
    "acceleration": {"external": {"acceleration": ["-0.3*x + sin(y)", "x*y*z/m", "-tanh(z)*q"]}},
    "of some": [
        {"external": {"name": "one", "potential": "m*x^4/4 + q*y", "on": "half"}},
        {"external": {"name": "other", "acceleration": ["-y*m", "x", "1/(1 + r^2)"]}},
        {"uniform_gravity": {"acceleration": [0.1, -0.2, 0.3]}},
        {"lennard_jones": {"strength": 0.7, "length": 0.3}},
    ],
    "of the package": [{"harmonic_trap": {"frequencies": [1.0, 2.0, 0.5]}}, {"logarithmic_halo": {"speed": 1.2, "core": 0.3}}],
}
"""Fields that depend on the place alone, and forces beside them."""


def scene_of(force, **more):
    particles = [
        {"body": {"position": place.tolist(), "velocity": speed.tolist(), "mass": 1 + k % 3, "charge": (-1.0) ** k}}
        for k, (place, speed) in enumerate(zip(PLACES, SPEEDS))
    ]
    forces = force if isinstance(force, list) else [force]
    return load_scene({"particles": particles, "forces": forces, "integrator": {"leapfrog": {"dt": 1e-3}}, **more})


def ratio_to_allowance(spec, contender_of, precision):
    """The largest error of an acceleration, as a share of what rounding may cause."""
    error, allowed = error_and_allowance(spec, contender_of, precision, PLACES, SPEEDS)
    with np.errstate(divide="ignore"):  # no error where nothing is allowed, as along an axis without a force, is no error
        return float(np.max(np.divide(error, allowed, out=np.zeros_like(error), where=~(error == 0.0))))


def error_and_allowance(spec, contender_of, precision, places, speeds):
    """The errors of the accelerations, and what rounding may cause."""
    start = assemble(spec)
    contender = contender_of(spec, start, precision)
    place, speed, found = contender.accelerations_at(places, speeds)
    contender.close()
    reference = NumpyForces(spec, bodies(start, 3, [precision]))
    place, speed = kept(place, precision)[None], kept(speed, precision)[None]
    exact = reference.acceleration(place, speed)[0]
    unit = ROUNDING[precision] + ROUNDING["f64"]
    limits = Limits(unit, SMALLEST[precision])
    size, more = (each[0] for each in reference.magnitude(place, speed, np.arange(len(places)), limits))
    allowed = (ROUNDINGS + reference.most_terms()) * unit * size + more
    return np.abs(np.pad(found, ((0, 0), (0, 3 - found.shape[1]))) - exact), allowed


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


def halved(forces, **more):
    """Sixty particles of which the first thirty are a group."""
    lattice = {"name": "half", "shape": [30], "lower": [0, 0, 0], "upper": [3, 1, 2], "mass": 1.5}
    others = [
        {"body": {"position": place.tolist(), "mass": 1 + k % 3, "charge": (-1.0) ** k}} for k, place in enumerate(PLACES[30:])
    ]
    return load_scene(
        {
            "particles": [{"lattice": lattice}, *others],
            "forces": forces if isinstance(forces, list) else [forces],
            "integrator": {"leapfrog": {"dt": 1e-3}},
            **more,
        }
    )


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("law", PLACE_FIELDS)
@pytest.mark.sampled(3)
def test_opencl_evaluates_the_same_field(opencl, law, precision):
    ratio = ratio_to_allowance(halved(PLACE_FIELDS[law]), OpenclContender, precision)
    assert ratio < 1.0 and (ratio > 1e-6 or precision == "f64")


@pytest.mark.parametrize("integrator", ["leapfrog", "velocity_verlet", "rk4"])
@pytest.mark.parametrize("damping", [0.0, 0.4])
@pytest.mark.sampled(3)
def test_opencl_moves_particles_in_a_field(opencl, integrator, damping):
    """Beside the kernels of the program, with and without friction of springs: 200 steps of some 50 roundings each."""
    springs = [{"link": {"between": [k, k + 1], "stiffness": 3.0, "damping": damping}} for k in range(40)]
    spec = halved(PLACE_FIELDS["of some"][:3], springs=springs, integrator={integrator: {"dt": 1e-3}}, run={"steps": 200})
    start, ends = assemble(spec), []
    for made in (OpenclContender(spec, start, "f64"), TaichiContender(spec, start, "cpu", "f64")):
        made.restart()
        made.advance(200)
        ends.append(made.read()[0])
        made.close()
    assert np.abs(ends[0] - start.position).max() > 1e-3
    assert np.abs(ends[0] - ends[1]).max() < 200 * 50 * 10 * np.finfo(float).eps


@pytest.mark.parametrize("fault", ["an axis", "a group", "the mass"])
def test_a_wrong_field_in_opencl_is_noticed(opencl, fault, monkeypatch):
    wrong = {
        "an axis": ("const REAL x = here.x, y = here.y", "const REAL x = here.y, y = here.x"),
        "a group": ("((on & (1 << n)) != 0)", "((on | (1 << n)) != 0)"),
        "the mass": ("m = numbers.x", "m = 1 + numbers.y"),
    }[fault]
    assert ratio_to_allowance(halved(PLACE_FIELDS["of some"]), OpenclContender, "f64") < 1.0
    change_kernel(monkeypatch, "motion", *wrong)
    assert ratio_to_allowance(halved(PLACE_FIELDS["of some"]), OpenclContender, "f64") > 1e3


@pytest.mark.parametrize(
    ("force", "message"),
    [
        ({"external": {"acceleration": ["-vx", "0", "0"]}}, "external: it depends on the velocity"),
        ({"external": {"acceleration": ["sin(t)", "0", "0"]}}, "external: it depends on the time"),
        ({"magnetic_field": {"field": [0, 0, 1]}}, "magnetic_field: it depends on the velocity"),
        ([{"external": {"name": f"f{k}", "potential": "x"}} for k in range(32)], "32 fields, there are up to 31"),
    ],
)
def test_fields_of_more_than_the_place_are_refused_by_name(opencl, force, message):
    spec = halved(force)
    with pytest.raises(BackendError, match=message):
        OpenclContender(spec, assemble(spec), "f64")


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


SEVERAL = [
    {"bond": {"name": "all", "potential": "0.3*(l - rest)^4"}},
    {
        "bond": {
            "name": "morse",
            "potential": "D*(1 - exp(-a*(l - l0)))^2",
            "parameters": {"D": 5, "a": 2, "l0": 1},
            "of": "block",
        }
    },
    {"bond": {"name": "sheet", "potential": "k*abs(l - rest)^2.5", "parameters": {"k": 0.9}, "of": "sheet"}},
]
OTHERS = {
    "pairs": [
        {"lennard_jones": {"strength": 0.2, "length": 0.3, "between": ["block", "sheet"]}},
        {"newtonian_gravity": {"softening": 0.1}},
    ],
    "field": [{"uniform_gravity": {"acceleration": [0, 0, -1]}}, {"linear_drag": {"coefficient": 0.2}}],
}


def networks(forces, *, stiffness=1.5, damping=0.0, **more):
    """A block and a sheet, whose particles have up to 26 and 8 springs, and one spring between them."""
    block = {"lattice": {"name": "block", "shape": [3, 3, 4], "lower": [0, 0, 0], "upper": [2, 2, 3], "scatter": [0.1] * 3}}
    sheet = {"lattice": {"name": "sheet", "shape": [6, 4], "lower": [4, 0, 0], "upper": [9, 3, 0], "scatter": [0.1] * 3}}
    sheet["lattice"]["mass"] = 2.0
    given = {"stiffness": stiffness, "damping": damping}
    kinds = itertools.product(("block", "sheet"), ("nearest", "diagonal"))
    springs = [{"lattice_links": {"of": each, "neighbors": kind, **given}} for each, kind in kinds]
    springs.append({"link": {"between": ["block[0]", "sheet[0]"], **given, "rest_length": 3.0}})
    scene = {"particles": [block, sheet], "springs": springs, "forces": forces, "integrator": {"leapfrog": {"dt": 1e-3}}}
    return load_scene(scene | more)


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("law", BONDS)
@pytest.mark.sampled(3)
def test_opencl_evaluates_the_same_bond(opencl, law, precision):
    assert ratio_to_allowance(bonded(BONDS[law]), OpenclContender, precision) < 1.0


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("others", OTHERS)
@pytest.mark.parametrize("damping", ["none", "axial", "full"])
@pytest.mark.parametrize("stiffness", [1.5, 0.0], ids=["beside springs", "alone"])
@pytest.mark.sampled(6)
def test_opencl_evaluates_several_bonds_beside_other_forces(opencl, stiffness, damping, others, precision):
    given = {"stiffness": stiffness, "damping": 0.0 if damping == "none" else 0.3}
    spec = networks(SEVERAL + OTHERS[others], **given, spring_damping="full" if damping == "full" else "axial")
    assert ratio_to_allowance(spec, OpenclContender, precision) < 1.0


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("potential", ["(l - rest)^4", "abs(l - rest)^2.5", "abs(l - rest)^3"])
def test_a_bond_of_no_force_is_judged_at_its_rest_length(potential, precision):
    """The length of a spring that is placed at rest is off by roundings: V′ ∝ (l − rest)³ is their cube, not their sum."""
    particles = [{"body": {"name": f"b{k}", "mass": 1, "position": place.tolist()}} for k, place in enumerate(PLACES)]
    springs = [{"link": {"between": [f"b{k}", f"b{k + 1}"], "stiffness": 0}} for k in range(len(PLACES) - 1)]
    scene = {"particles": particles, "springs": springs, "forces": [{"bond": {"potential": potential}}]}
    spec = load_scene(scene | {"integrator": {"leapfrog": {"dt": 1e-3}}})
    error, allowed = error_and_allowance(spec, taichi, precision, PLACES, 0 * SPEEDS)
    assert np.all(error <= allowed)


BOND_FAULTS = {
    "every spring has every bond, by fours": ("springs", "AS_CHOICE((bonds & (1 << n)) != 0)", "AS_CHOICE(bonds != 0)"),
    "every spring has every bond, one by one": ("springs", "((bonds & (1 << n)) != 0)\nstatic", "(bonds != 0)\nstatic"),
    "the bits of other springs": ("springs", "vload4(0, bonds + h)", "vload4(0, bonds)"),
    "no bonds beyond four": ("springs", "#define AND_BONDS_OF_ONE(h) +", "#define AND_BONDS_OF_ONE(h) +0*"),
    "another rest length": ("springs", "(distance, rest, vload4", "(distance, rest.yxzw, vload4"),
    "the length for its square": ("springs", "bond_weight_of_one(distance,", "bond_weight_of_one(squared,"),
}


@pytest.mark.parametrize("damping", [0.0, 0.3], ids=["undamped", "damped"])
@pytest.mark.parametrize("fault", BOND_FAULTS)
@pytest.mark.sampled(3)
def test_a_fault_of_bonds_in_opencl_is_noticed(opencl, fault, damping, monkeypatch):
    change_kernel(monkeypatch, *BOND_FAULTS[fault])
    assert ratio_to_allowance(networks(SEVERAL, damping=damping), OpenclContender, "f64") > 1e6


@pytest.mark.parametrize("integrator", ["leapfrog", "velocity_verlet", "rk4"])
@pytest.mark.sampled(1)
def test_bonds_move_alike_in_opencl(opencl, integrator):
    """Both sum in f64: over 50 steps, far fewer than a period, an error of rounding grows by less than a thousand."""
    spec = networks(SEVERAL, damping=0.2, integrator={integrator: {"dt": 2e-3}})
    start, ends = assemble(spec), []
    for contender_of in (taichi, OpenclContender):
        contender = contender_of(spec, start, "f64")
        contender.begin(start.position, start.velocity)
        contender.advance(50)
        ends.append(contender.read())
        contender.close()
    for found, expected in zip(*ends):
        np.testing.assert_allclose(found, expected, atol=1000 * ROUNDING["f64"] * np.abs(expected).max(), rtol=0.0)


def test_bonds_that_opencl_lacks_are_named(opencl):
    many = [{"bond": {"name": f"b{n}", "potential": "l^2"}} for n in range(32)]
    for forces, words in (
        (many, "no OpenCL kernel for 32 bonds, there are up to 31"),
        ([{"bond": {"potential": "1e200*l"}}], "no OpenCL kernel for bond: .* is no number of f32"),
        ([{"bond": {"potential": "f(l)"}}], "no OpenCL kernel for bond: it calls a function through points"),
        ([{"pair": {"potential": "f(r)"}}], "no OpenCL kernel for pair: it calls a function through points"),
        ([*SEVERAL, {"external": {"acceleration": ["-vx", 0, 0]}}], "for external: it depends on the velocity"),
    ):
        spec = networks(forces, functions={"f": {"points": [[0, 0], [3, 1], [30, 0.5]]}})
        with pytest.raises(BackendError, match=words):
            OpenclContender(spec, assemble(spec), "f32")


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
