"""Forces that are formulas of the scene: their derivatives, their runs beside forces of the package, and bad texts."""

from pathlib import Path

import mpmath
import numpy as np
import pytest
from compiled import CompiledForces, random_snapshot

from mpp_taichi import Simulation, component
from mpp_taichi.device import backends
from mpp_taichi.errors import PrecisionError, SceneError
from mpp_taichi.forces._composition import built
from mpp_taichi.scene.formulas.array_steps import ArrayArithmetic
from mpp_taichi.scene.formulas.external_law import external_law
from mpp_taichi.scene.formulas.fields import FormulaText
from mpp_taichi.scene.formulas.pair_law import pair_law
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.location import Location
from mpp_taichi.scene.spec import ComponentSpec
from mpp_taichi.sweep.replicas import Bench, MemberDevice
from mpp_taichi.sweep.runner import run_members
from mpp_taichi.sweep.store import SweepStore

NUMBERS = (("D", 0.7), ("a", 1.2), ("n", 9.0), ("s", 0.9))
PAIRS = [
    "4*D*((s/r)^12 - (s/r)^6)",
    "D*(1 - exp(-a*(r - s)))^2",
    "-D*exp(-r/s)/r",
    "D*log(r)",
    "D*(s/r)^n - a*(s/r)^(n/2)",
    "D*exp(-a*r) - s/r^6",
    "D*r^2.5 + tanh(a*r)/s + cos(r)",
    "(r - s)^12",
    "sqrt(r^2 + s^2) + sinh(r/5) - cosh(r/7) + atan(r) + tan(r/9)",
    "asin(r/9) + acos(r/8) + log10(r) + radians(r) + degrees(r)/90 + hypot(r, a) + sin(r)^2",
    "1/(1 + D*r^2)^1.5 + r**0.5 - r^-3 + 2^r",
    "-r/(a + r*(D + r))",
]
DISTANCES = (0.31, 0.9, 1.7, 4.2)
DIGITS = 40
PYTHON_NAMES = ("sqrt", "exp", "log", "log10", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh")


def by_mpmath(text, order, at, **values):
    """The derivative of a formula by differences in 40 digits, which shares nothing with SymPy's derivatives."""
    names = {name: getattr(mpmath, name) for name in PYTHON_NAMES}
    names |= {"radians": mpmath.radians, "degrees": mpmath.degrees, "hypot": mpmath.hypot}
    numbers = {name: mpmath.mpf(value) for name, value in values.items()}
    code = compile(text.replace("^", "**"), "formula", "eval")
    with mpmath.workdps(DIGITS):
        return mpmath.diff(lambda r: eval(code, {}, {**names, **numbers, "r": r}), mpmath.mpf(at), order)  # noqa: S307


@pytest.mark.parametrize("text", PAIRS)
def test_derivatives_of_pairs_are_those_of_a_calculation_in_forty_digits(text):
    """With r = 1/u, g = V′/r, dg/du = −r² dg/dr and d²g/du² = r⁴ d²g/dr² + 2 r³ dg/dr."""
    law = pair_law(text, NUMBERS, ())
    for r in DISTANCES:
        with mpmath.workdps(DIGITS):
            value, first, second, third = (by_mpmath(text, order, r, **dict(NUMBERS)) for order in range(4))
            shape = first / r
            rate = second / r - first / r**2
            bend = third / r - 2 * second / r**2 + 2 * first / r**3
            expected = [float(each) for each in (shape, -(r**2) * rate, r**4 * bend + 2 * r**3 * rate, value)]
            sizes = [float(abs(each)) for each in (value, first, second, third)]
        found = [
            each.run(ArrayArithmetic, {"u": 1.0 / r}, 1.0 / r)[0] for each in (law.shape, law.slope, law.curvature, law.energy)
        ]
        # Some fifty roundings, of terms that may cancel: those of V are at most thirty times as large here.
        scale = 30.0 * max(sizes) * (1.0 + r) ** 4 * (1.0 + 1.0 / r) ** 3
        np.testing.assert_allclose(found, expected, rtol=1e-13, atol=50 * 2.0**-53 * scale + 1e-100)


@pytest.mark.parametrize("text", PAIRS)
def test_numbers_that_are_live_give_the_law_of_fixed_numbers(text):
    fixed = pair_law(text, NUMBERS, ())
    live = pair_law(text, (), tuple(name for name, _ in NUMBERS))
    r = np.array(DISTANCES)
    np.testing.assert_allclose(live.shape_at(r, dict(NUMBERS)), fixed.shape_at(r, {}), rtol=1e-11)
    np.testing.assert_allclose(live.energy_at(r, dict(NUMBERS)), fixed.energy_at(r, {}), rtol=1e-11, atol=1e-14)


@pytest.mark.parametrize(
    ("text", "shape"),
    [("4*D*((s/r)^12 - (s/r)^6)", 11), ("-D*m1*m2/r", 4), ("D*exp(-a*r)", 6)],
)
def test_a_formula_costs_what_a_careful_hand_would_write(text, shape):
    """Steps beside numbers and names: Lennard-Jones has u², u⁴, u⁸, u³, u⁶, a product, a difference, and two products more."""
    steps = [step for step in pair_law(text, NUMBERS, ()).shape.steps if step[0] not in ("number", "name")]
    assert len(steps) <= shape


@pytest.fixture
def cpu():
    backends.start("cpu", "f64")


def entry(name, **parameters):
    texts = {key: FormulaText(value, {}, 3) if isinstance(value, str) else value for key, value in parameters.items()}
    given = {"potential": None, "acceleration": None} if name == "external" else {"softening": 0.0}
    return ComponentSpec(name, {**given, "name": None, **texts}, Location("a test", 1, 1))


@pytest.mark.parametrize(
    ("law", "force"),
    [
        ({"potential": "-2.5*m1*m2/r", "softening": 0.05}, ("newtonian_gravity", {"strength": 2.5, "softening": 0.05})),
        ({"potential": "0.5*q1*q2/r", "softening": 0.1}, ("coulomb", {"coulomb_constant": 0.5, "softening": 0.1})),
    ],
)
def test_formulas_of_known_forces_are_these_forces(cpu, law, force):
    snapshot = random_snapshot(20)
    known = CompiledForces([component.build("forces", *force)], snapshot)
    found = CompiledForces([built(entry("pair", **law))], snapshot)
    expected = known.acceleration(snapshot.position, snapshot.velocity)
    # A pull has some ten roundings either way, and nineteen pulls are added.
    bound = 30 * 2.0**-53 * np.abs(expected).max() * 19
    np.testing.assert_allclose(found.acceleration(snapshot.position, snapshot.velocity), expected, rtol=0, atol=bound)
    energy = known.potential(snapshot.position, snapshot.velocity)
    assert found.potential(snapshot.position, snapshot.velocity) == pytest.approx(energy, rel=1e-13)


def field(position, velocity, mass, charge, time):
    """The acceleration of FIELD by hand."""
    x, y, z = position.T
    gradient = np.stack([2 * x + 0.3 * y**2, 0.6 * x * y + np.cos(y), np.zeros_like(z)], axis=1)
    return -gradient - (charge / mass)[:, None] * position / np.linalg.norm(position, axis=1)[:, None]


FIELD = "m*(x^2 + 0.3*x*y^2 + sin(y)) + q*r"


def test_a_field_is_minus_the_gradient_of_its_potential_over_the_mass(cpu):
    snapshot = random_snapshot(12)
    found = CompiledForces([built(entry("external", potential=FIELD))], snapshot).acceleration()
    expected = field(snapshot.position, snapshot.velocity, snapshot.mass, snapshot.charge, 0.0)
    np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-14)


def test_an_acceleration_may_depend_on_velocity_and_time(cpu):
    snapshot = random_snapshot(5)
    texts = tuple(FormulaText(text, {}, 3) for text in ("-0.2*v*vx", "vz*cos(3*t)", "-x*t"))
    force = built(entry("external", acceleration=texts))
    found = CompiledForces([force], snapshot).acceleration(snapshot.position, snapshot.velocity)
    v, t = snapshot.velocity, 0.3  # compiled.TIME
    speed = np.linalg.norm(v, axis=1)
    expected = np.stack([-0.2 * speed * v[:, 0], v[:, 2] * np.cos(3 * t), -snapshot.position[:, 0] * t], axis=1)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-15)
    assert force.depends_on_velocity and force.depends_on_time and not force.conserves_energy


@pytest.mark.parametrize("axis", range(3))
def test_derivatives_of_a_field_along_the_motion_are_those_of_forty_digits(axis):
    """Along x(τ) = x + v τ + a τ²/2 the acceleration has the derivatives ȧ and ä in τ at 0, for the second with this a."""
    law = external_law("x^2*y + exp(z*x) - m*log(1 + x^2 + 2*y^2) + sin(3*t)*z", None, 3, (), ())
    at = {"x": 0.3, "y": -0.4, "z": 0.5, "t": 0.2, "m": 1.5}
    motion = {"vx": 0.7, "vy": 0.2, "vz": -0.6}
    push = {"ax": -0.3, "ay": 0.8, "az": 0.1}

    def gradient(tau):
        x, y, z = (at[name] + motion[f"v{name}"] * tau + push[f"a{name}"] * tau**2 / 2 for name in "xyz")
        m, t = at["m"], at["t"] + tau
        inner = 1 + x**2 + 2 * y**2
        slopes = (
            2 * x * y + z * mpmath.exp(z * x) - 2 * m * x / inner,
            x**2 - 4 * m * y / inner,
            x * mpmath.exp(z * x) + mpmath.sin(3 * t),
        )
        return -slopes[axis] / m

    values = at | motion | push
    for order, program in enumerate((law.acceleration, law.jerk, law.snap)):
        with mpmath.workdps(DIGITS):
            expected = float(mpmath.diff(gradient, 0, order))
        assert law.numbers(program, values)[axis] == pytest.approx(expected, rel=1e-12)


THREE = {
    "particles": [
        {"body": {"position": [1, 0, 0.1], "velocity": [0, 0.6, 0], "mass": 1, "charge": 0.4}},
        {"body": {"position": [-0.8, 0.1, 0], "velocity": [0, -0.5, 0.2], "mass": 2, "charge": -0.7}},
        {"body": {"position": [0.2, 1.3, -0.4], "velocity": [0.3, 0, 0], "mass": 0.5, "charge": 1}},
    ],
    "forces": [
        {"pair": {"name": "morse", "potential": "D*(1 - exp(-a*(r - l)))^2", "parameters": {"D": 1, "a": 1.2, "l": 1.1}}},
        {"pair": {"name": "yukawa", "potential": "-k*m1*m2/r*exp(-r/3)", "parameters": {"k": 0.7}}},
        {"external": {"potential": "m/2*w^2*(x^2 + 2*y^2 + z^2) + 0.1*m*x*y^2", "parameters": {"w": 0.8}}},
    ],
    "run": {"duration": 2.0},
}


def end_of(method, dt, scene=THREE, **device):
    with Simulation({**scene, "integrator": {method: {"dt": dt}}}, **device) as simulation:
        simulation.run()
        return simulation.snapshot().position


@pytest.mark.parametrize(
    ("method", "order"),
    [
        *[("leapfrog", 2), ("yoshida4", 4), ("chin4a", 4), ("hermite4", 4), ("hermite6", 6), ("rk4", 4)],
        *[("implicit_midpoint", 2), ("newmark", 2), ("imex_midpoint", 2)],
    ],
)
@pytest.mark.sampled(4)
def test_methods_keep_their_order_with_formulas(method, order):
    """Halving the step divides the error by 2^order, up to the next term of the error, which is a tenth or less here."""
    exact = end_of("ias15", 0.05, precision="f64")
    errors = [np.abs(end_of(method, dt, precision="f64") - exact).max() for dt in (0.02, 0.01)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.35)
    assert errors[1] > 1e-12  # the errors are those of the steps, and not of rounding


@pytest.mark.parametrize(
    ("backend", "precision", "plan", "digits"),
    [
        *[("cpu", "f32", "serial", 4e-5), ("cpu", "f64", "parallel", 1e-12), ("cpu", "f32", "parallel", 4e-5)],
        *[("vulkan", "f32", "serial", 4e-5), ("vulkan", "f32", "parallel", 4e-5), ("cpu", "ds", "serial", 4e-5)],
    ],
)
@pytest.mark.sampled(3)
def test_devices_and_plans_agree(backend, precision, plan, digits, request):
    """200 steps with some 100 roundings of 2⁻²⁴ each that add at random, and grow with the time in a bound motion."""
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    expected = end_of("leapfrog", 0.01, backend="cpu", precision="f64", plan="serial")
    found = end_of("leapfrog", 0.01, backend=backend, precision=precision, plan=plan)
    assert np.abs(found - expected).max() < digits


@pytest.mark.parametrize("plan", ["serial", "parallel"])
def test_a_choice_in_the_lanes_of_a_vector_is_that_of_single_numbers(plan):
    """Kinks and a cutoff, with pairs on both sides, in one kick from rest; the parallel plan sums a cutoff in whole vectors."""
    place = np.random.default_rng(8).uniform(0.0, 2.0, (64, 3))
    scene = {
        "particles": [{"body": {"mass": 1.0 + k / 64, "position": each.tolist()}} for k, each in enumerate(place)],
        "forces": [
            {"pair": {"name": "kinked", "potential": "max(0, 1 - r)^2 + 0.1*max(r, 0.7)"}},
            {"pair": {"name": "cut", "potential": "3*(r - 1)^2", "cutoff": 0.8}},
        ],
        "integrator": {"symplectic_euler": {"dt": 2.0**-10}},
    }
    with Simulation(scene, backend="cpu", precision="f64", plan=plan) as simulation:
        found = simulation.run(steps=1).snapshot().velocity * 2.0**10
    away = place[:, None] - place[None, :]
    r = np.linalg.norm(away, axis=2) + np.eye(64)
    assert ((0.7 < r) & (r < 1.0)).sum() > 100 and (r < 0.7).sum() > 100 and (r > 1.0).sum() > 100
    slope = -2.0 * np.maximum(0.0, 1.0 - r) + 0.1 * (r > 0.7) + 6.0 * (r - 1.0) * (r < 0.8)
    force = -(slope / r * (1.0 - np.eye(64)))[:, :, None] * away
    expected = force.sum(axis=1) / (1.0 + np.arange(64) / 64)[:, None]
    assert np.abs(found - expected).max() < 64 * 10 * 2.0**-53 * np.abs(force).max()  # ten roundings of each term


RATIONAL = {
    **THREE,
    "forces": [
        {"pair": {"potential": "4*((0.7/r)^12 - (0.7/r)^6) + q1*q2*0/r"}},
        {"external": {"potential": "m/2*(x^2 + 2*y^2 + z^2)"}},
    ],
}


@pytest.mark.parametrize("backend", ["cpu", "vulkan"])
@pytest.mark.sampled(2)
def test_arithmetic_alone_runs_in_double_single_numbers(backend, request):
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    scene = {**RATIONAL, "forces": [{"pair": {"potential": "4*((0.7/r)^12 - (0.7/r)^6)"}}, RATIONAL["forces"][1]]}
    expected = end_of("leapfrog", 0.01, scene, backend="cpu", precision="f64")
    found = end_of("leapfrog", 0.01, scene, backend=backend, precision="df64")
    assert np.abs(found - expected).max() < 1e-10  # some 2⁻⁴⁶ a step, against 6e-8 in f32


def test_exponentials_are_refused_where_a_precision_lacks_them(software_vulkan):
    with pytest.raises(PrecisionError, match="the force morse does not carry low parts"):
        end_of("leapfrog", 0.01, backend="cpu", precision="df64")
    with pytest.raises(PrecisionError, match="morse calls exp, which vulkan has only in f32"):
        end_of("leapfrog", 0.01, backend="vulkan", precision="f64")


@pytest.mark.sampled(2)
def test_energy_is_kept_and_momentum_too():
    scene = {**THREE, "forces": THREE["forces"][:2], "integrator": {"ias15": {"dt": 0.1}}}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        start = simulation.snapshot()
        energy = simulation.mechanics()["total_energy"]
        simulation.run()
        end = simulation.snapshot()
        assert simulation.mechanics()["total_energy"] == pytest.approx(energy, rel=1e-13)
    momentum = [each.mass @ each.velocity for each in (start, end)]
    np.testing.assert_allclose(momentum[1], momentum[0], rtol=0, atol=1e-13)


# Numbers that change while a scene runs

MOVED = {"forces[0].pair.parameters.a": 0.7, "forces[1].pair.parameters.k": 1.5, "forces.external.parameters.w": 1.6}


def test_sliders_move_the_numbers_of_formulas():
    """A run with sliders moved at its start is the run of a scene with these numbers, but for rounding of folded constants."""
    sliders = [{"set": path, "from": 0.1, "to": 3} for path in MOVED]
    with Simulation({**THREE, "integrator": {"leapfrog": {"dt": 0.01}}, "sliders": sliders}, backend="cpu") as simulation:
        for path, value in MOVED.items():
            simulation.set(path, value)
        simulation.run()
        found = simulation.snapshot().position
    expected = load_scene({**THREE, "integrator": {"leapfrog": {"dt": 0.01}}}, overrides=MOVED)
    with Simulation(expected, backend="cpu") as simulation:
        simulation.run()
        np.testing.assert_allclose(found, simulation.snapshot().position, rtol=0, atol=1e-12)
    assert np.abs(found - end_of("leapfrog", 0.01, backend="cpu")).max() > 0.1


@pytest.mark.parametrize(
    "path", ["forces.second.parameters.k", "forces.second.pair.parameters.k", "forces[1].pair.parameters.k"]
)
def test_a_slider_finds_a_formula_by_its_name(path):
    forces = [{"pair": {"name": name, "potential": "-k*m1*m2/r", "parameters": {"k": 1}}} for name in ("first", "second")]
    method = {"leapfrog": {"dt": 0.01}}
    spec = load_scene({**THREE, "integrator": method, "forces": forces, "sliders": [{"set": path, "from": 1, "to": 2}]})
    assert [entry.live for entry in spec.forces] == [(), ("parameters.k",)]


def test_a_timeline_changes_numbers_of_formulas():
    event = {"at": 1.0, "set": {"forces.external.parameters.w": 1.6}}
    changed = end_of("leapfrog", 0.01, {**THREE, "timeline": [event]}, backend="cpu")
    assert np.abs(changed - end_of("leapfrog", 0.01, backend="cpu")).max() > 0.1


@pytest.mark.parametrize("method", ["leapfrog", "dop853", "ias15"])
@pytest.mark.sampled(2)
def test_members_of_a_sweep_have_numbers_of_their_own(method):
    """Each member moves as the scene with its numbers, but for the rounding of constants that kernels fold beforehand."""
    vary = {"forces[0].pair.parameters.a": [0.7, 1.2], "forces.external.parameters.w": [0.5, 1.0, 1.6]}
    scene = {**THREE, "particles": named(THREE["particles"]), "integrator": {method: {"dt": 0.02}}}
    scene["sweep"] = {"vary": vary, "measure": [{"position": {"of": "b0", "axis": "x"}}]}
    store = SweepStore(Path("unused"), load_scene(scene).resolved, "scene", {"backend": "cpu", "precision": "f64"}, 4)
    numbers = list(range(store.plan.count))
    values, bench = store.plan.values(numbers), Bench(MemberDevice("cpu", "f64", 1))
    rows = run_members(numbers, values, store.resolved, store.source, bench, store.own)
    assert [row.status for row in rows] == ["ok"] * 6
    for row, given in zip(rows, values):
        alone = load_scene({key: value for key, value in scene.items() if key != "sweep"}, overrides=dict(given))
        with Simulation(alone, backend="cpu", precision="f64") as simulation:
            simulation.run()
            assert row.values[0] == pytest.approx(simulation.snapshot().position[0, 0], abs=1e-11)
    assert len({row.values[0] for row in rows}) == 6


def named(particles):
    return [{"body": {**each["body"], "name": f"b{k}"}} for k, each in enumerate(particles)]


# Bad texts


@pytest.mark.parametrize(
    ("line", "column", "message"),
    [
        ('pair: {potential: "k/r"}', 24, "unknown name 'k'"),
        ('pair: {potential: "1/r + floor(r)"}', 30, "floor has no derivative"),
        ('pair: {potential: "1/r + r // 2"}', 30, "// has no derivative"),
        ('pair: {potential: "r % 2"}', 24, "% has no derivative"),
        ('pair: {potential: "1/r + 9^9^9^9"}', 32, "not a real number of ordinary size"),
        ('pair: {potential: "r + 1/0"}', 28, "division by zero"),
        ('pair: {potential: "sqrt(0 - 2) + r"}', 24, "not a real number"),
        ('pair: {potential: "r^r^r^r^r^r^r^r^r"}', 0, "more than 6 functions and powers"),
        ('pair: {potential: "q1*q2/r + m1*m2/r"}', 24, "must be a function of r times the same function"),
        ('pair: {potential: "m1/r"}', 24, "the forces would not be opposite"),
        ("pair: {potential: \"__import__('os').system('x')\"}", 24, "only the named functions"),
        ('pair: {potential: "r.real"}', 24, "only numbers, names"),
        ('pair: {potential: "atan2(r, 1)"}', 24, "atan2 cannot stand in the formula of a force"),
        ('pair: {potential: "s/r", parameters: {s: 1, r: 2}}', 49, "'r' has a meaning of its own"),
        ('pair: {potential: "s/r", parameters: {s: 1, pi: 2}}', 53, "'pi' has a meaning of its own"),
        ('pair: {potential: "s/r", parameters: {s: x}}', 46, "unknown name 'x'"),
        ('pair: {potential: "s/r", parameters: [1]}', 42, "must be a mapping of names to numbers"),
        ("external: {}", 5, "has no formula, must have potential or acceleration"),
        ('external: {potential: "vx"}', 28, "unknown name 'vx'"),
        ("external: {acceleration: [x, y]}", 30, "must be a list of 3 formulas"),
        ("external: {acceleration: [x, y + nope, 1]}", 38, "unknown name 'nope'"),
        ('external: {potential: "log(r)"}', 28, "gives no number for"),
        ('pair: {potential: "log(r - 2)"}', 24, "V is no number at r = 1, the distance of"),
        ('pair: {potential: "sqrt(r - 1)*(r - 1)^0"}', 24, "the force is no number at r = 1"),
    ],
)
def test_a_text_that_is_no_law_is_refused_at_its_character(line, column, message, tmp_path):
    scene = tmp_path / "scene.yaml"
    scene.write_text(
        "particles: [{body: {position: [1, 0, 0], mass: 1}}, {body: {position: [0, 0, 0], mass: 1}}]\n"
        f"forces:\n  - {line}\nintegrator: {{leapfrog: {{dt: 0.1}}}}\nrun: {{steps: 1}}\n"
    )
    with pytest.raises(SceneError) as caught, Simulation(scene, backend="cpu"):
        pass
    told = str(caught.value)
    assert message in told
    assert f"scene.yaml:3:{column}" in told if column else "scene.yaml:3:" in told, told


def test_charges_keep_their_signs():
    """|q₁ q₂| repels whatever the signs, and a root of q₁ q₂, which is real for equal signs alone, is no product."""
    bodies = [{"body": {"position": [k, 0, 0], "mass": 1, "charge": q}} for k, q in enumerate((-1.0, 2.0))]
    scene = {"particles": bodies, "forces": [{"pair": {"potential": "abs(q1*q2)/r"}}], "integrator": {"leapfrog": {"dt": 0.1}}}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        np.testing.assert_allclose(simulation.accelerations()[:, 0], [-2.0, 2.0], rtol=1e-15)
    for potential, told in [
        ("sqrt(q1*q2)/r", "same function"),
        ("sqrt(q1)*sqrt(q2)/r", "the factor of particle 0 .* no number"),
    ]:
        with pytest.raises(SceneError, match=told), Simulation({**scene, "forces": [{"pair": {"potential": potential}}]}):
            pass


@pytest.mark.parametrize("force", [{"pair": {"potential": "1/r"}}, {"external": {"potential": "m*r^2"}}])
def test_a_constant_of_the_scene_may_not_hide_a_variable(force):
    """With `constants: {r: 2}` the formula 1/r would be a number."""
    scene = {**THREE, "constants": {"r": 2, "unused": 1}, "forces": [force]}
    with pytest.raises(SceneError, match="r is a constant of the scene and a variable of this formula, rename the constant"):
        end_of("leapfrog", 0.1, scene)


def test_two_pairs_need_names_of_their_own():
    forces = [{"pair": {"potential": "1/r"}}, {"pair": {"potential": "2/r"}}]
    with pytest.raises(SceneError, match="pair is in the list already, allowed: once; give each a name: of its own"):
        end_of("leapfrog", 0.1, {**THREE, "forces": forces})


def test_a_kink_is_told(caplog):
    scene = {**THREE, "forces": [{"pair": {"potential": "max(0, 1 - r)^2 + 1/r"}}]}
    end_of("leapfrog", 0.01, scene, backend="cpu")
    assert "max has a kink, at which a step loses its order" in caplog.text
    with pytest.raises(SceneError, match="needs the derivative of every force, which pair lacks"):
        end_of("hermite4", 0.01, scene, backend="cpu")


def test_a_number_that_no_formula_uses_is_told(caplog):
    """Numbers of the cutoff and of one of three accelerations are used; a misspelt name is told with its place."""
    numbers = {"k": 1, "far": 5, "kk": 2, "old": 3}
    forces = [
        {"pair": {"potential": "k/r", "parameters": numbers, "cutoff": "2*far"}},
        {"external": {"acceleration": ["0", "0", "-g"], "parameters": {"g": 1}}},
    ]
    end_of("leapfrog", 0.01, {**THREE, "forces": forces}, backend="cpu")
    told = [record.getMessage() for record in caplog.records if "of its parameters" in record.getMessage()]
    assert len(told) == 1 and "pair: no formula of it uses kk, old of its parameters" in told[0]


def test_methods_made_for_gravity_name_the_formulas():
    with pytest.raises(SceneError, match="knows no forces but .*, not morse, yukawa, external"):
        end_of("wisdom_holman", 0.01)


SECOND = {"position": [3.4e-10, 0, 0], "mass": 6.6e-26}


@pytest.mark.parametrize(
    ("force", "told"),
    [
        ({"lennard_jones": {"strength": 1.65e-21, "length": 3.4e-10}}, "lennard_jones: in f32 the force at r = 3.4e-10 is"),
        ({"pair": {"potential": "1e-21*exp(r*1e12)*1e-40"}}, "pair: in f32 the force at r = "),
    ],
)
def test_formulas_beyond_single_precision_are_refused(force, told):
    """In metres and kilograms, u⁸ of argon is 10⁷⁶, and f32 ends at 10³⁸."""
    atoms = [{"body": {"position": [0, 0, 0], "mass": 6.6e-26}}, {"body": SECOND}]
    scene = {"particles": atoms, "forces": [force], "integrator": {"leapfrog": {"dt": 1e-15}}, "run": {"steps": 2}}
    with pytest.raises(PrecisionError, match=told):
        Simulation(scene, backend="cpu", precision="f32")
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        assert np.isfinite(simulation.accelerations()).all()


@pytest.mark.parametrize("name", ["leapfrog", "yoshida4"])
def test_plans_take_a_force_in_time_at_the_same_time(name):
    """A body without other forces, from rest: the sums of both plans are those of the same few kicks."""
    scene = {
        "particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}],
        "forces": [{"external": {"acceleration": ["cos(3*t)", "t", "exp(-t)"]}}],
        "integrator": {name: {"dt": 0.05}},
    }
    found = []
    for plan in ("serial", "parallel"):
        with Simulation(scene, backend="cpu", precision="f64", plan=plan) as simulation:
            simulation.run(steps=20)
            found.append(simulation.snapshot().position)
    # 20 steps of at most 4 kicks and drifts, each of which rounds places and speeds below 2 by half an ulp.
    assert np.abs(found[1] - found[0]).max() < 20 * 4 * 2 * 2.0**-52
