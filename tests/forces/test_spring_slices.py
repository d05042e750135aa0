"""Springs in slices: their sums are those of the rows, and steps take them where they may."""

import sys
from dataclasses import replace

import numpy as np
import pytest
import taichi as ti
from compiled import snapshot_of
from pair_sums import started

from mpp_taichi import component
from mpp_taichi.device.fast_taichi import bitcode
from mpp_taichi.forces import _spring_slices
from mpp_taichi.forces._spring_slices import slices_of
from mpp_taichi.forces._total_force import TotalForce
from mpp_taichi.forces.spring import Spring
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.snapshot import Springs
from mpp_taichi.state.state import State
from mpp_taichi.state.vector_layout import VectorLayout
from scenes import INTEGRATORS, REQUIRED, takes_friction

HAS_LANES = sys.platform == "linux" and bitcode.has_avx512()
pytestmark = [
    pytest.mark.fast_taichi("spring_lanes"),
    pytest.mark.skipif(not HAS_LANES, reason="spring_lanes needs Linux on a processor with AVX-512"),
]
EPSILON = {"f32": 2.0**-24, "f64": 2.0**-53}
LONGEST = 9  # half-springs of a particle in a random network


@pytest.fixture(params=["f32", "f64"])
def precision(request):
    for _ in started(request.param):
        yield request.param


def network(count, dimensions, seed):
    """Particles with up to `LONGEST` half-springs each, some with none, the last one among the ends, two at the same place."""
    random = np.random.default_rng(seed)
    position, velocity = random.uniform(-1, 1, (2, count, 3))
    position[:, dimensions:] = velocity[:, dimensions:] = 0.0
    position[1] = position[0]
    left = np.full(count, LONGEST)
    left[2] = 0  # no spring at all
    pairs = [(0, 1)]
    for i, j in random.integers(0, count, (3 * count, 2)):
        if i != j and left[i] > 0 and left[j] > 0:
            pairs.append((i, j))
            left[[i, j]] -= 1
    pairs.append((count - 1, 0))
    number = len(pairs)
    springs = Springs(
        between=np.array(pairs, np.int32),
        stiffness=random.uniform(1, 5, number),
        damping=random.uniform(0.1, 1, number),
        rest_length=random.uniform(0.3, 0.9, number),
        color=np.ones((number, 3)),
    )
    return snapshot_of(position, velocity=velocity, mass=random.uniform(0.5, 2, count), springs=springs)


@ti.data_oriented
class BothSums:
    """The forces of the springs of a snapshot on all particles, from slices and from rows."""

    def __init__(self, snapshot, dimensions, precision, damping):
        bond = Spring(damping=damping)
        self.total = TotalForce((bond,), snapshot.particle_count, dimensions)
        self.total.slices = slices_of(snapshot, (bond,), precision)
        assert self.total.has_slices
        self.count, self.bond, self.damped = snapshot.particle_count, bond, damping != "none"
        self.state = State(
            snapshot,
            dimensions=dimensions,
            needs=self.total.needs,
            scratch_count=0,
            layout=VectorLayout.BY_PARTICLE,
            work=self.total.work_fields(),
        )
        self.total.fill(self.state)
        self.total.place_springs(self.state, snapshot.springs)
        self.found = ti.Vector.field(dimensions, float, self.count)

    @ti.kernel
    def _in_slices(self, elastic: ti.template()):
        self.total.sum_slices(self.state, self.state.velocity, self.damped, elastic)
        for i in range(self.count):
            self.found[i] = self.total.slices.pull(self.state, i)

    def in_slices(self, elastic):
        self._in_slices(elastic)
        return self.found.to_numpy().astype(float)


def forces_of(snapshot, damped, elastic):
    """The forces on all particles in float64, and the sums of the sizes of their parts."""
    (near, far), springs = snapshot.springs.between.T, snapshot.springs
    d, u = (getattr(snapshot, name)[far] - getattr(snapshot, name)[near] for name in ("position", "velocity"))
    length = np.linalg.norm(d, axis=1)
    axis = np.divide(d, length[:, None], out=np.zeros_like(d), where=length[:, None] > 0)
    pull = springs.stiffness * (length - springs.rest_length) if elastic else np.zeros(len(length))
    size = springs.stiffness * (length + springs.rest_length) if elastic else np.zeros(len(length))
    if damped:
        pull = pull + springs.damping * np.einsum("ij,ij->i", u, axis)
        size = size + springs.damping * np.linalg.norm(u, axis=1) * 2
    result, sizes = np.zeros_like(d, shape=snapshot.position.shape), np.zeros(len(snapshot.position))
    np.add.at(result, near, pull[:, None] * axis)
    np.add.at(result, far, -pull[:, None] * axis)
    np.add.at(sizes, near, size)
    np.add.at(sizes, far, size)
    return result, sizes


@pytest.mark.sampled(3)
@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize(("damping", "elastic"), [("none", True), ("axial", True), ("axial", False)])
@pytest.mark.parametrize("count", [48, 67, 130])
def test_sums_of_slices_are_the_forces_of_the_springs(count, damping, elastic, dimensions, precision, monkeypatch):
    """To rounding: each part of a sum has some 12 operations, and there are at most `LONGEST` + 1 parts.

    Positions and numbers are rounded to the precision first. A difference of two places has an error of two roundings of 1, and
    the direction of a short spring moves by that error over its length.
    """
    monkeypatch.setattr(_spring_slices, "FEWEST", 0)
    monkeypatch.setattr(_spring_slices, "MOST_FILLING", 100.0)
    kind = np.float32 if precision == "f32" else np.float64
    whole = network(count, dimensions, seed=count)
    springs = whole.springs
    numbers = {name: getattr(springs, name).astype(kind).astype(float) for name in ("stiffness", "damping", "rest_length")}
    places = {name: getattr(whole, name).astype(kind).astype(float) for name in ("position", "velocity")}
    snapshot = replace(whole, springs=replace(springs, **numbers), **places)
    found = BothSums(snapshot, dimensions, precision, damping).in_slices(elastic)
    expected, sizes = forces_of(snapshot, damping != "none", elastic)
    (near, far) = springs.between.T
    lengths = np.linalg.norm(snapshot.position[far] - snapshot.position[near], axis=1)
    shortest = lengths[lengths > 0].min()
    bound = EPSILON[precision] * sizes * (12 + LONGEST + 1 + 4 / shortest)
    assert (np.abs(found - expected[:, :dimensions]).max(axis=1) <= bound).all()
    assert np.abs(expected).max() > 1e3 * bound.max()  # else the comparison would mean nothing
    assert not found[2].any()


SIDE, MASS, DT, STEPS = 15, 0.02, 5e-4, 40


def sheet(integrator="leapfrog", damping=0.4, **more):
    """A sheet of 15 × 15 masses with 812 springs that have 5 % of tension, in a field; two corners are held."""
    lattice = {"name": "sheet", "shape": [SIDE, SIDE], "lower": [0, 0, 0], "upper": [1.4, 1.4, 0], "mass": MASS}
    own = {"stiffness": 40.0, "damping": damping, "prestretch": 1.05}
    links = [{"of": "sheet", **own, "stiffness": 40.0}, {"of": "sheet", **own, "stiffness": 20.0, "neighbors": "diagonal"}]
    return {
        "title": "Sheet",
        "particles": [{"lattice": {**lattice, "fixed": "upper_corners"}}],
        "springs": [{"lattice_links": link} for link in links],
        "forces": [{"uniform_gravity": {"acceleration": [0.3, -9.81, 0.2]}}],
        "integrator": {integrator: {"dt": DT, **REQUIRED.get(integrator, {})}},
        "run": {"duration": 0.05},
        **more,
    }


def end_of(scene, *, slices=True, changes=(), **options):
    """The positions after 40 steps; `slices` says whether the springs must be in slices. `changes` are made in the middle."""
    with pytest.MonkeyPatch.context() as patched:
        if not slices:
            patched.setattr(_spring_slices, "FEWEST", 10**9)
        with Simulation(scene, backend="cpu", **options) as simulation:
            simulation.run(steps=STEPS // 2)
            for path, value in dict(changes).items():
                simulation.set(path, value)
            simulation.run(steps=STEPS - STEPS // 2)
            assert simulation.launcher.total_force.has_slices == slices
            return simulation.snapshot().position


def rounding_of_runs(precision, evaluations):
    """How far rounding may take two runs of the sheet apart that sum the same forces in other ways.

    An acceleration has an error of some 30 roundings (see above) of at most 8 springs of 40 × 0.14 on a mass. It adds up over
    the evaluations of all steps as in free motion, since the springs only pull back. Each evaluation rounds the places, of at
    most 1.4, and the velocities, of at most 1 over the run.
    """
    duration, each = STEPS * DT, EPSILON[precision]
    return 2 * each * (30 * 8 * 40 * 0.14 / MASS * duration**2 / 2 + STEPS * evaluations * (1.4 + 1.0 * duration))


METHODS = [name for name in (*INTEGRATORS, "langevin") if component.declaration("integrators", name).flags.get("sums_slices")]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("damping", [0.4, 0.0])
@pytest.mark.parametrize(
    ("method", "precision_of_run"), [*((method, "f64") for method in METHODS), ("leapfrog", "f32"), ("rk4", "f32")]
)
def test_every_method_moves_a_sheet_in_slices_as_it_does_in_rows(method, damping, precision_of_run):
    if damping and not takes_friction(method):
        pytest.skip("takes no friction")
    scene = sheet(method, damping)
    found, rows = (end_of(scene, slices=slices, precision=precision_of_run) for slices in (True, False))
    evaluations = component.flag("integrators", method, "typical_evaluations", 1)
    assert np.abs(found - rows).max() <= rounding_of_runs(precision_of_run, 4 * evaluations)


def test_the_comparison_of_runs_sees_one_per_cent_of_the_damping():
    found, other = (end_of(sheet(damping=damping)) for damping in (0.4, 0.404))
    assert np.abs(found - other).max() > 1e3 * rounding_of_runs("f64", 4)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("damping", [0.4, 0.0])
@pytest.mark.parametrize("method", ["leapfrog", "velocity_verlet", "kahan_li6", "rk4"])
def test_bits_do_not_depend_on_plan_and_threads(method, damping):
    scene = sheet(method, damping)
    serial = end_of(scene, plan="serial")
    for threads in (1, 2):
        assert np.array_equal(serial, end_of(scene, plan="parallel", threads=threads))


@pytest.mark.parametrize("changes", [{"springs[0].lattice_links.stiffness": 80.0}, {"springs[1].lattice_links.damping": 2.0}])
@pytest.mark.parametrize("sliders", [True, False])
def test_changed_springs_act_from_then_on(changes, sliders):
    (path,) = changes
    moved = [{"set": path, "from": 0.1, "to": 100.0}] if sliders else []
    scene = sheet(sliders=moved) if sliders else sheet()
    found, rows = (end_of(scene, slices=slices, changes=changes) for slices in (True, False))
    assert np.abs(found - rows).max() <= rounding_of_runs("f64", 1)
    assert np.abs(found - end_of(scene)).max() > 1e-6


def test_a_timeline_is_followed():
    later = [{"at": 0.01, "set": {"springs[0].lattice_links.stiffness": 10.0}}]
    scene = sheet(timeline=later)
    found, rows = (end_of(scene, slices=slices) for slices in (True, False))
    assert np.abs(found - rows).max() <= rounding_of_runs("f64", 1)
    assert np.abs(found - end_of(sheet())).max() > 1e-6


def with_spring(**numbers):
    scene = sheet()
    for entry in scene["springs"]:
        entry["lattice_links"].update(numbers)
    return scene


GRAVITY = {"newtonian_gravity": {"strength": 1e-6, "softening": 0.1}}
BOND = {"bond": {"potential": "0.1*(l - l0)^4", "parameters": {"l0": 0.1}}}


@pytest.mark.parametrize(
    ("scene", "options"),
    [
        (sheet(forces=[GRAVITY]), {}),
        (sheet(forces=[BOND]), {}),
        (with_spring(breaks_at=3.0), {}),
        (sheet(spring_damping="full"), {}),
        (sheet("ias15"), {}),
        (sheet("implicit_midpoint"), {}),
        (sheet(), {"precision": "f32c"}),
        (sheet(), {"precision": "df64"}),
        (sheet(damping=0.0, expect={"lyapunov": {"below": 1e3}}), {}),
    ],
    ids=["pairs", "bond", "limits", "full damping", "adaptive", "implicit", "f32c", "df64", "tangent"],
)
@pytest.mark.sampled(2)
def test_other_steps_take_no_slices(scene, options):
    with Simulation(scene, backend="cpu", **options) as simulation:
        simulation.run(steps=2)
        assert not simulation.launcher.total_force.has_slices
        assert not any(name.startswith("slice_") for name in simulation.launcher.state.quantities)


def test_networks_with_few_springs_or_uneven_rows_take_no_slices():
    few = sheet()
    few["particles"][0]["lattice"].update(shape=[4, 4])
    hub = {"body": {"mass": 1.0, "position": [0, 1, 0]}}
    wheel = {
        "title": "Wheel",
        "particles": [
            {"lattice": {"name": "rim", "shape": [300, 1], "lower": [0, 0, 0], "upper": [3, 0, 0], "mass": 1.0}},
            hub,
        ],
        "springs": [{"link": {"between": [k, 300], "stiffness": 1.0}} for k in range(300)],
        "integrator": {"leapfrog": {"dt": 0.01}},
        "run": {"duration": 1.0},
    }
    for scene in (few, wheel):
        assert end_of(scene, slices=False) is not None
        with Simulation(scene, backend="cpu") as simulation:
            simulation.run(steps=1)
            assert not simulation.launcher.total_force.has_slices
