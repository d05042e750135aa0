"""The certificate of agreement: correct kernels differ from the reference by rounding; planted faults are reported as bugs."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import taichi as ti

from mpp_taichi.arithmetic.particle_update import drift_particle, kick_particle
from mpp_taichi.cli._terminal import plain
from mpp_taichi.compare import busy, neighbors, numpy_reference, numpy_steps, scaling, tree_forces, words
from mpp_taichi.compare.certificate import Judge, verdict
from mpp_taichi.compare.course import COPIES, margin
from mpp_taichi.compare.evidence import Evidence, follow, gather
from mpp_taichi.compare.numpy_contender import NumpyContender
from mpp_taichi.compare.numpy_reference import NumpyForces, bodies
from mpp_taichi.compare.taichi_contender import TaichiContender
from mpp_taichi.contacts.sweep.contact_group import ContactGroup
from mpp_taichi.contacts.sweep.contact_memory import ContactMemory
from mpp_taichi.device import backends
from mpp_taichi.device.fast_taichi import bitcode, series_walk
from mpp_taichi.errors import BackendError
from mpp_taichi.forces.newtonian_gravity import NewtonianGravity
from mpp_taichi.integrators._splitting import Splitting
from mpp_taichi.neighbors.all_pairs import AllPairs
from mpp_taichi.neighbors.tree_nodes import TreeNodes
from mpp_taichi.neighbors.tree_series import TreeSeries
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble
from mpp_taichi.types import Template
from scenes import cluster, everything, irregular_network

LOOKS = [1, 4, 16, 60]


class Case:
    """A scene with its reference run, to judge contenders by."""

    def __init__(self, scene, looks=LOOKS):
        self.spec = load_scene(scene)
        self.start = assemble(self.spec)
        self.judge = Judge(self.spec, self.start, float(self.spec.integrator.parameters["dt"]))
        self.looks = looks
        self.course = self.judge.follow(("f64", "f32"), looks) if looks else None

    def evidence(self, contender):
        try:
            return gather(contender, self.judge.states(), self.looks)
        finally:
            contender.close()

    def verdict(self, contender, precision):
        evidence = self.evidence(contender)
        findings = self.judge.forces(evidence, precision)
        return verdict(findings + self.course.findings(evidence, precision))

    def taichi(self, backend="cpu", precision="f64", **more):
        backends.stop()
        return TaichiContender(self.spec, self.start, backend, precision, threads=2, **more)


@pytest.fixture(scope="module")
def five():
    return Case(cluster(5))


@pytest.fixture(scope="module")
def crowd():
    return Case(cluster(300), looks=[1, 3])


@pytest.fixture(scope="module")
def mixture():
    return Case(everything(integrator="velocity_verlet"))


@pytest.fixture(scope="module")
def network():
    return Case(irregular_network(60, 130, dt=0.02))


def agrees(found):
    return found["verdict"] == "rounding" and 0.0 <= found["decided_by"]["ratio"] <= 1.0 and len(found["findings"]) >= 3


# --- sound kernels ----------------------------------------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_sound_kernels_of_the_cpu_differ_by_rounding(mixture, network, precision):
    assert agrees(mixture.verdict(mixture.taichi(precision=precision), precision))
    assert agrees(network.verdict(network.taichi(precision=precision, plan="parallel"), precision))


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.sampled(3)
def test_sound_kernels_of_vulkan_differ_by_rounding(software_vulkan, five, network, precision):
    for case in (five, network):
        assert agrees(case.verdict(case.taichi("vulkan", precision), precision))


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.sampled(3)
def test_sound_kernels_of_opencl_differ_by_rounding(crowd, network, precision):
    for case in (crowd, network):
        assert agrees(case.verdict(opencl_or_skip(case, precision), precision))


def test_numpy_is_its_own_reference(mixture):
    found = mixture.verdict(NumpyContender(mixture.spec, mixture.start, "f64"), "f64")
    # The copies are steps of the same text, but side by side: sums may be taken in another order.
    assert agrees(found) and found["decided_by"]["difference"] < 1e-14


def opencl_or_skip(case, precision, **more):
    from mpp_taichi.compare.opencl_contender import OpenclContender

    try:
        return OpenclContender(case.spec, case.start, precision, **more)
    except BackendError as error:
        pytest.skip(f"no OpenCL here: {error}")


# --- planted faults ---------------------------------------------------------------------------------------------------


class WrongSign(NewtonianGravity):
    @ti.func
    def shape(self, inverse_distance):
        return -inverse_distance * inverse_distance * inverse_distance


class LostQuadrupole(TreeNodes):
    @ti.func
    def pull(self, rows: ti.template(), row, way: ti.template(), inverse):
        turned = [inverse * 0.0 for axis in ti.static(range(self.dimensions))]
        along = inverse * inverse * inverse * rows[row + self.dimensions]
        return along, inverse * 0.0, turned, inverse * rows[row + self.dimensions]


class TwiceAsSoft(TreeSeries):
    sound = TreeSeries.run

    def run(self, softening, *, potential):
        TwiceAsSoft.sound(self, 2.0 * softening, potential=potential)


class DroppedPair(AllPairs):
    @ti.func
    def _weights(self, state: ti.template(), i, j, distance_squared):
        on_i = 0.0
        on_j = 0.0
        for group in ti.static(self.groups):
            inverse_distance = 1.0 / ti.sqrt(distance_squared + group.softening_squared)
            for member in ti.static(group.members):
                shape = member.force.shape(inverse_distance)
                on_i += member.force.response(state, i) * (member.force.source(state, j) * shape)
                on_j += member.force.response(state, j) * (member.force.source(state, i) * shape)
        if i == 2 and j == 4:
            on_i = 0.0
        return on_i, on_j


class LostBarrier(Splitting):
    """Kick and drift in one loop, where others still look at the positions."""

    @ti.func
    def kick_and_drift(
        self,
        state: ti.template(),
        total_force: ti.template(),
        first,
        time,
        k,
        kick_time: ti.template(),
        drift_time: ti.template(),
        sums: ti.template(),
        drifts: ti.template(),
    ):
        for i in range(first, first + total_force.particle_count):
            acceleration = total_force.local_acceleration(state, first, i, time, False)
            kick_particle(state, i, kick_time, 2 * k, acceleration)
            if ti.static(drifts):
                drift_particle(state, i, drift_time, 2 * k + 1)


def plant(monkeypatch, owner, name, faulty):
    """The function of a faulty class in the place of the sound one."""
    monkeypatch.setattr(owner, name, faulty.__dict__[name])


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.sampled(3)
def test_a_wrong_sign_is_a_bug(monkeypatch, five, precision):
    plant(monkeypatch, NewtonianGravity, "shape", WrongSign)
    found = five.verdict(five.taichi(precision=precision), precision)
    assert found["verdict"] == "bug" and any(each["check"] == "force at the start" for each in broken(found))


def judged_tree(precision):
    """The verdict on the forces of a tree of an accuracy of 0.01."""
    scene = cluster(2000)
    scene["forces"][0]["newtonian_gravity"] |= {"solver": "tree", "accuracy": 1e-2}
    case = Case(scene, looks=[])
    return verdict(case.judge.forces(case.evidence(case.taichi(precision=precision)), precision))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize(
    ("owner", "name", "faulty"),
    [
        (TreeNodes, "pull", LostQuadrupole),
        pytest.param(TreeSeries, "run", TwiceAsSoft, marks=pytest.mark.fast_taichi("series_walk")),
    ],
    ids=["walk", "series"],
)
def test_a_tree_is_judged_by_the_accuracy_that_it_promises(monkeypatch, owner, name, faulty, precision):
    if owner is TreeNodes:
        monkeypatch.setattr(series_walk, "can_sum", lambda: False)
    elif not bitcode.has_avx512():
        pytest.skip("series need a processor with AVX-512")
    sound = judged_tree(precision)
    assert sound["verdict"] == "rounding" and len(sound["findings"]) == 2
    # Terms of many nodes that are cut are a good part of what is allowed: a body that is near exact would be of no tree.
    assert sound["decided_by"]["ratio"] > 0.01 and sound["decided_by"]["of"] == "its own gravity"
    plant(monkeypatch, owner, name, faulty)
    found = judged_tree(precision)
    assert found["verdict"] == "bug" and {each["check"] for each in broken(found)} == {
        "force at the start",
        "force at the shaken start",
    }


def test_few_particles_of_a_sample_may_be_off_by_chance():
    assert tree_forces.exceptions(2000, 2000) == 20
    for sample in (30, 1000):
        few = tree_forces.exceptions(sample, 10**6)
        draws = np.random.default_rng(0).random((20_000, sample)) < tree_forces.SHARE
        assert (draws.sum(axis=1) > few).mean() < 1e-4  # one in a million, of which 20,000 draws see none or one
        assert few < sample / 5


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_a_dropped_pair_is_a_bug(monkeypatch, five, precision):
    plant(monkeypatch, AllPairs, "_weights", DroppedPair)
    found = five.verdict(five.taichi(precision=precision), precision)
    forces = [each for each in broken(found) if each["check"].startswith("force")]
    assert found["verdict"] == "bug" and {each["particle"] for each in forces} == {2}


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.sampled(3)
def test_a_lost_barrier_between_kick_and_drift_is_a_bug(monkeypatch, precision):
    case = Case(irregular_network(60, 130, dt=0.02, damping=0.0))
    plant(monkeypatch, Splitting, "kick_and_drift", LostBarrier)
    found = case.verdict(case.taichi(precision=precision), precision)
    # The forces are right; it is the step that is not, and only the trajectory shows it.
    assert found["verdict"] == "bug" and all("steps" in each["check"] for each in broken(found))


def test_a_lost_barrier_in_local_memory_is_a_bug(monkeypatch, crowd):
    """The first of two in a loop; PoCL puts the second there by itself, at the end of every loop with a barrier."""
    from mpp_taichi.compare.opencl_package import load_opencl

    sound = opencl_or_skip(crowd, "f64", variant="tiled")
    assert agrees(crowd.verdict(sound, "f64"))
    program = load_opencl("program")
    read = program.read

    def without(name):
        return read(name).replace("barrier(CLK_LOCAL_MEM_FENCE);", "", 1)

    monkeypatch.setattr(program, "read", without)
    assert crowd.verdict(opencl_or_skip(crowd, "f64", variant="tiled"), "f64")["verdict"] == "bug"


def test_a_backend_may_stand_in_for_the_reference(monkeypatch):
    """Neighbors of a start show what rounding may do: sound kernels stay within, a lost barrier does not."""
    case = Case(irregular_network(60, 130, dt=0.02, damping=0.0), looks=[2, 8, 30])
    push = case.judge.roundings * case.judge.dt * np.abs(case.judge.reference("f64").acceleration(*states_of(case))[0])
    places, speeds = neighbors.starts(case.start, ["f32"], case.judge.free, push)
    followed = follow(NumpyContender(case.spec, case.start, "f64"), list(zip(places, speeds)), case.looks)
    case.course = neighbors.course(["f32"], case.looks, *followed, updates=2, size=case.judge.size, given_by="beside numpy")
    assert agrees(case.verdict(case.taichi(precision="f32"), "f32"))
    plant(monkeypatch, Splitting, "kick_and_drift", LostBarrier)
    assert case.verdict(case.taichi(precision="f32"), "f32")["verdict"] == "bug"


def disks(solver, **changes):
    """36 in a box and a course of them on the CPU, to judge others beside."""
    lattice = {"shape": [6, 6], "lower": [0.5, 0.5], "upper": [5.5, 5.5], "radius": 0.3, "scatter": [0.1, 0.1], **changes}
    scene = {
        "dimensions": 2,
        "particles": [{"lattice": {**lattice, "velocity": ["sin(7 * u + 3 * v)", "cos(5 * v - 2 * u)"]}}],
        "contacts": {"hard_spheres": {"solver": solver}},
        "walls": [{"box": {"lower": [0, 0], "upper": [6, 6]}}],
        "integrator": {"leapfrog": {"dt": 0.005}},
    }
    spec = load_scene(scene)
    backends.stop()
    start, looks = assemble(spec), [20, 100, 150]
    judge = Judge(spec, start, 0.005)
    base = TaichiContender(spec, start, "cpu", "f64", threads=2)
    places, speeds = neighbors.starts(start, ["f64", "f32"], judge.free, np.zeros_like(start.position))
    followed = follow(base, list(zip(places, speeds)), looks)
    base.close()
    limits = neighbors.limits_of_contacts(start, 0.005, looks, in_groups=solver == "simultaneous")
    course = neighbors.course(["f64", "f32"], looks, *followed, updates=2, size=judge.size, given_by="cpu", limits=limits)
    return SimpleNamespace(spec=spec, start=start, judge=judge, looks=looks, course=course)


@pytest.fixture(scope="module")
def gas():
    return disks("pairwise")


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.sampled(3)
def test_spheres_that_bounce_alike_differ_by_rounding_or_are_not_judged(gas, precision):
    contender = opencl_or_skip(gas, precision)
    evidence = gather(contender, gas.judge.states(), gas.looks, forces=False)
    contender.close()
    moved = np.abs(evidence.places[-1] - gas.start.position).max()
    found = verdict(gas.course.findings(evidence, precision))
    assert moved > 0.3 and found["verdict"] == {"f64": "rounding", "f32": "not judged"}[precision]


def test_an_impulse_that_does_not_act_on_the_other_sphere_is_a_bug(monkeypatch, gas):
    from mpp_taichi.compare.opencl_package import load_opencl

    opencl_or_skip(gas, "f64").close()
    program = load_opencl("program")
    read = program.read
    sound = "v[j] += impulse * (w_j * n)"
    assert sound in read("hard_spheres")
    monkeypatch.setattr(program, "read", lambda name: read(name).replace(sound, "v[j] += 0 * impulse"))
    contender = opencl_or_skip(gas, "f64")
    evidence = gather(contender, gas.judge.states(), gas.looks, forces=False)
    contender.close()
    assert verdict(gas.course.findings(evidence, "f64"))["verdict"] == "bug"


class WeakBounce(ContactMemory):
    """A thousandth of the impulse is missing."""

    @ti.func
    def restitution(self, nominal, i, j, t):
        return ti.cast(0.998, float), 0


@pytest.mark.parametrize("backend", ["cpu", pytest.param("vulkan", marks=pytest.mark.sampled(3))])
def test_exact_contacts_are_judged_and_a_weak_one_is_a_bug(monkeypatch, request, backend):
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    gas = disks("swept")
    assert judged(gas, backend) == "rounding"
    plant(monkeypatch, ContactMemory, "restitution", WeakBounce)
    assert judged(gas, backend) == "bug"


SOUND_PUSH = ContactGroup.push


class WeakPush(ContactGroup):
    """A thousandth of the impulse is missing."""

    @ti.func
    def push(self, state: Template, c, impulse, impulse_low, lost):
        SOUND_PUSH(self, state, c, 0.999 * impulse, impulse_low, lost)


@pytest.mark.parametrize("backend", ["cpu", pytest.param("vulkan", marks=pytest.mark.sampled(3))])
def test_contacts_in_groups_are_judged_in_f64_and_a_weak_one_is_a_bug(monkeypatch, request, backend):
    """Three rows of four touch at the start, as in a cradle: whether they do is no matter of f64's rounding; it is of f32's."""
    if backend == "vulkan":
        request.getfixturevalue("software_vulkan")
    gas = disks("simultaneous", shape=[4, 3], lower=[1.5, 1.0], upper=[4.5, 5.0], radius=0.5, scatter=[0.0, 0.0])
    assert judged(gas, backend) == "rounding"
    assert judged(gas, backend, "f32") == "not judged"
    plant(monkeypatch, ContactGroup, "push", WeakPush)
    assert judged(gas, backend) == "bug"


def judged(gas, backend, precision="f64"):
    """The verdict on what another run of a gas does."""
    backends.stop()
    contender = TaichiContender(gas.spec, gas.start, backend, precision)
    evidence = gather(contender, gas.judge.states(), gas.looks, forces=False)
    contender.close()
    assert np.abs(evidence.places[-1] - gas.start.position).max() > 0.3
    return verdict(gas.course.findings(evidence, precision))["verdict"]


def states_of(case):
    place, speed = case.judge.states()[1]
    return place[None], speed[None]


def broken(found):
    return [each for each in found["findings"] if each["ratio"] > 1.0]


@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_one_pair_among_a_million_is_missed(precision):
    """1024 equal masses: a pair is a thousandth of a force, and rounding of f32 allows some 10⁻⁵ of it."""
    case = Case(cluster(1024), looks=[1])
    reference = case.judge.reference(precision)
    states = [tuple(numpy_reference.kept(values, precision) for values in state) for state in case.judge.states()]
    felt = np.stack([reference.acceleration(place[None], speed[None])[0] for place, speed in states])
    evidence = Evidence(*(np.stack(column) for column in zip(*states)), felt, np.zeros(0, int), *[np.zeros((0, 0, 3))] * 2)
    assert verdict(case.judge.forces(evidence, precision))["verdict"] == "rounding"
    place, mass = states[0][0], reference.bodies.mass[0]
    away = place[600] - place[17]
    felt[0, 17] -= mass[600] * away / (away @ away + 0.1**2) ** 1.5
    found = verdict(case.judge.forces(evidence, precision))
    assert found["verdict"] == "bug" and found["decided_by"]["particle"] == 17


def test_a_nan_position_is_reported_as_a_bug(five):
    evidence = five.evidence(NumpyContender(five.spec, five.start, "f64"))
    evidence.places[-1, 3, 1] = np.nan
    found = plain(verdict(five.course.findings(evidence, "f64")))
    assert found["verdict"] == "bug" and found["decided_by"]["particle"] == 3
    row = {"label": "cpu", "backend": "cpu", "precision": "f64", "status": "ok", "step_seconds": None, **found}
    assert "is off by none of" in words.sentence({"rows": [row]})


# --- the reference ----------------------------------------------------------------------------------------------------


def test_forces_of_the_reference_are_minus_the_gradient_of_its_energy():
    spec = load_scene(everything(damping=0.0, drag=0.0))
    start = assemble(spec)
    reference = NumpyForces(spec, bodies(start, 3, ["f64"]))
    force = reference.acceleration(start.position[None], start.velocity[None])[0] * start.mass[:, None]
    step = 1e-5  # error of the central difference step² · third derivative ~ 1e-10 · 10; rounding 1e-16 / 1e-5
    for i, axis in np.ndindex(start.particle_count, 3):
        shift = np.zeros_like(start.position)
        shift[i, axis] = step
        energies = [reference.energy((start.position + s * shift)[None], start.velocity[None])[0, 1] for s in (1, -1)]
        expected = -(energies[0] - energies[1]) / (2.0 * step) if start.free[i, axis] else 0.0
        assert force[i, axis] == pytest.approx(expected, abs=1e-8)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("method", numpy_steps.METHODS)
def test_steps_of_the_reference_have_the_order_of_their_method(method):
    """Halving dt, errors fall by 2^order; the next term, a twentieth of a radian smaller, moves that by less than a fifth."""
    scene = {
        "particles": [
            {"body": {"mass": 1e9, "position": [0, 0, 0], "free": False}},
            {"body": {"mass": 1.0, "position": [1.2, 0, 0], "velocity": [0.3, 0.5, 0]}},
        ],
        "springs": [{"link": {"between": [0, 1], "stiffness": 1.0, "rest_length": 1.0, "damping": 0.2}}],
        "integrator": {"leapfrog": {"dt": 0.1}},
    }
    spec = load_scene(scene)
    start = assemble(spec)
    given = bodies(start, 3, ["f64"])
    counts = np.array([20, 40, 320])
    ends = []
    for count in counts:
        steps = numpy_steps.NumpySteps(NumpyForces(spec, given), method, np.array([2.0 / count]))
        steps.start(start.position[None], start.velocity[None])
        steps.advance(int(count))
        ends.append(steps.position[0, 1])
    coarse, fine = (np.linalg.norm(end - ends[2]) for end in ends[:2])
    order = {"symplectic_euler": 1, "leapfrog": 2, "velocity_verlet": 2}.get(method, 4)
    assert math.log2(coarse / fine) == pytest.approx(order, abs=0.3)


def test_the_margin_is_as_rare_as_it_says():
    """Of seven normal numbers the last is beyond m times the largest of the six others with the chance that margin bounds."""
    random = np.random.default_rng(3)
    draws = np.abs(random.standard_normal((400_000, COPIES + 1)))
    beyond = draws[:, -1] / draws[:, :-1].max(axis=1)
    times = 3.0
    bound = 1e-6 * (margin(1) / times) ** COPIES  # the bound falls with the power of the copies
    seen = float(np.mean(beyond > times))
    assert 0.0 < seen <= bound < 10.0 * seen
    # Places and speeds at eight samples, of six copies: the two factors that docs/compare.md tells.
    assert [round(margin(2 * 8 * count)) for count in (3, 3000)] == [24, 76]


def test_an_integrator_that_the_reference_lacks_is_refused_by_name():
    scene = {**cluster(5), "integrator": {"yoshida6": {"dt": 0.01}}}
    spec = load_scene(scene)
    with pytest.raises(BackendError, match="not by yoshida6"):
        NumpyContender(spec, assemble(spec), "f64")
    drive = {"harmonic_drive": {"force": [1, 0, 0], "angular_frequency": 1.0}}
    spec = load_scene({**cluster(5), "forces": [drive]})
    assert "no harmonic_drive" in numpy_reference.refusal(spec)


# --- numbers of the table ---------------------------------------------------------------------------------------------


def test_warnings_of_a_busy_machine():
    assert busy.warnings(0.1, 2, {"cpu f64": 0.02}) == []
    load, spread = busy.warnings(1.7, 2, {"cpu f64": 0.02, "vulkan f32": 0.31})
    assert "load average 1.70 on 2 processors" in load and "vulkan f32 31 %" in spread and "cpu" not in spread
    assert busy.warnings(None, 2, {}) == []


def test_crossovers_lie_where_the_lines_meet():
    # 1e-6 N² and 1e-4 N meet at N = 100.
    curves = {"a f64": [(n, 1e-6 * n * n) for n in (8, 32, 128)], "b f64": [(n, 1e-4 * n) for n in (2, 8, 32, 128)]}
    assert scaling.crossovers(curves) == [{"faster": "b f64", "than": "a f64", "from": 100}]


def test_the_next_size_is_tried_only_where_it_fits():
    seen = [(2, 1e-6), (8, 4e-6)]  # a step grows like N; a size takes a second, and 0.1 s more where it is four times as large
    assert scaling.fits(seen, [1.0, 1.1], 32, 1.6) and not scaling.fits(seen, [1.0, 1.1], 32, 1.4)
    assert not scaling.fits([(2, 0.05), (8, 0.8)], [1.0, 2.0], 32, 1e9)  # N²: the next step takes 12.8 s
    assert scaling.fits([], [], 2, 1.0) and not scaling.fits([], [], 2, 0.0)


def test_generated_scenes_have_the_effects_of_theirs():
    for scene in (cluster(4), everything()):
        spec = load_scene(scene)
        made = load_scene(scaling.scene_of(spec, assemble(spec), 32))
        start = assemble(made)
        assert made.effects(len(start.springs)) == spec.effects(len(scene.get("springs", ())))
        assert 24 <= start.particle_count <= 40
