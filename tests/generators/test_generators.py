"""Generators: particles and springs against closed forms, direct sums and independent references."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ellipe, ellipk

from mpp_taichi import component
from mpp_taichi.cli.main import main
from mpp_taichi.errors import CapacityError, OutputError, SceneError, StateError
from mpp_taichi.generators._base import Center, GeneratorContext
from mpp_taichi.generators._elliptic import annulus_pull, elliptic_integrals
from mpp_taichi.generators.ring import Ring
from mpp_taichi.scene.estimate import Estimate, check_capacity, estimate
from mpp_taichi.scene.load import load_scene
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.assemble import assemble

K2 = 0.0172**2


def scene(particles, **changes):
    return {"particles": particles, "integrator": {"leapfrog": {"dt": 0.1}}, **changes}


def body(mass=1, position=(0, 0, 0), **more):
    return {"body": {"mass": mass, "position": list(position), **more}}


def made(particles, **changes):
    return assemble(load_scene(scene(particles, **changes)))


# --- elliptic integrals and the ring ------------------------------------------------------------------------------------


def test_elliptic_integrals_agree_with_scipy():
    k = np.concatenate([[0.0], np.logspace(-8, -0.001, 200), 1 - np.logspace(-12, -1, 30)])
    first, difference = elliptic_integrals(k)
    assert first == pytest.approx(ellipk(k**2), rel=1e-4)  # near k = 1, k² = m loses what 1 − k still has
    far = k < 0.9999
    assert first[far] == pytest.approx(ellipk(k[far] ** 2), rel=1e-11)
    assert difference[far] == pytest.approx(ellipk(k[far] ** 2) - ellipe(k[far] ** 2), rel=1e-11, abs=1e-15)


def test_elliptic_difference_keeps_its_digits_at_small_modulus():
    k = np.array([1e-3, 1e-6, 1e-9])
    assert elliptic_integrals(k)[1] == pytest.approx(np.pi / 4 * k**2 * (1 + 3 / 8 * k**2), rel=1e-10)


def test_annulus_pull_agrees_with_a_direct_sum_over_rings():
    """Rings of mass points, refined towards nothing: midpoint rule in radius and angle, away from the rims."""
    inner, outer, rings, points = 2.0, 2.5, 1500, 6000
    a = inner + (np.arange(rings) + 0.5) * (outer - inner) / rings
    angle = (np.arange(points) + 0.5) * 2 * np.pi / points
    for r in (0.7, 1.5, 3.0, 5.0):
        x, y = a[:, None] * np.cos(angle) - r, a[:, None] * np.sin(angle)
        weight = a[:, None] * (outer - inner) / rings * 2 * np.pi / points
        direct = -np.sum(weight * x / (x**2 + y**2) ** 1.5)
        assert annulus_pull(np.array(r), inner, outer) == pytest.approx(direct, rel=2e-6)


def test_annulus_pull_inside_the_ring_agrees_with_the_principal_value():
    """A ring of radius a has the potential −4aK(k)/(a+r), k² = 4ar/(a+r)²; their sum is differentiated."""

    def potential(r, count):
        a = 2.0 + (np.arange(count) + 0.5) * 0.5 / count
        m = 4 * a * r / (a + r) ** 2
        return -np.sum(4 * a / (a + r) * ellipk(m)) * 0.5 / count

    def pull(r, count):
        step = 0.5 / count  # whole cells: the logarithm's own cell moves along
        return (potential(r + step, count) - potential(r - step, count)) / (2 * step)

    for cells in (0.2, 0.5, 0.62):
        count = 20_000
        r = 2.0 + 0.5 / count * round(cells * count)
        assert annulus_pull(np.array(r), 2.0, 2.5) == pytest.approx(pull(r, count), rel=1e-4, abs=1e-3)


def test_a_far_annulus_pulls_like_a_point():
    area = np.pi * (2.5**2 - 2.0**2)
    assert annulus_pull(np.array(1e4), 2.0, 2.5) == pytest.approx(area / 1e8, rel=1e-6)


# r, v without ring, v with ρ = 0.02, v with M_ring = 0.02: appendix B of arXiv:1403.1695 recomputed, k = 0.0172
APPENDIX_B = [
    (1.5, 0.014044, 0.013743, 0.014002),
    (2.1, 0.011869, 0.010755, 0.011718),
    (2.25, 0.011467, 0.011881, 0.011526),
    (2.4, 0.011103, 0.013100, 0.011406),
    (3.0, 0.009930, 0.011241, 0.010126),
]


@pytest.mark.parametrize("column, ring_mass", [(1, 0.0), (2, 0.02 * np.pi * (2.5**2 - 2.0**2)), (3, 0.02)])
def test_circular_speeds_are_those_of_appendix_b(column, ring_mass):
    count = 10**9  # a continuum: the margin of one mean spacing leaves every r of the table alone
    ring = Ring(count=count, inner_radius=2.0, outer_radius=2.5, mass=ring_mass / count, velocity="with_ring")
    context = GeneratorContext(np.random.default_rng(0), K2, 0.0, lambda index: Center(np.zeros(3), np.zeros(3), 1.0))
    # Outside the ring the margin does not apply to the formula itself.
    r = np.array([row[0] for row in APPENDIX_B])
    inside = (r > 2.0) & (r < 2.5)
    speeds = ring.circular_speed(r[inside], 1.0, context)
    assert speeds == pytest.approx([row[column] for row in APPENDIX_B if 2.0 < row[0] < 2.5], abs=5.0e-7)
    density = ring_mass / (np.pi * (2.5**2 - 2.0**2))
    outside = np.sqrt(K2 / r + K2 * density * r * annulus_pull(r, 2.0, 2.5))
    assert outside == pytest.approx([row[column] for row in APPENDIX_B], abs=5.0e-7)


def ring_scene(**ring):
    given = {"count": 3072, "around": 0, "inner_radius": 2, "outer_radius": 2.5, "mass": 1e-8, **ring}
    return scene([body(radius=0.5), {"ring": given}], forces=[{"newtonian_gravity": {"strength": K2}}], seed=5)


def test_a_ring_is_uniform_in_area_and_angle():
    snapshot = assemble(load_scene(ring_scene()))
    x, y, z = snapshot.position[1:].T
    area = ((x**2 + y**2) - 4.0) / 2.25
    turn = np.arctan2(y, x) / (2 * np.pi) + 0.5
    for sample in (area, turn):  # Kolmogorov–Smirnov at 0.1 %
        assert np.max(np.abs(np.sort(sample) - (np.arange(3072) + 0.5) / 3072)) < 1.95 / np.sqrt(3072)
    assert not z.any()


def test_ring_orbits_are_circular_and_turn_from_x_to_y():
    snapshot = assemble(load_scene(ring_scene()))
    position, velocity = snapshot.position[1:], snapshot.velocity[1:]
    r = np.linalg.norm(position, axis=1)
    assert np.sum(velocity**2, axis=1) == pytest.approx(K2 / r, rel=1e-13)
    assert np.abs(np.sum(position * velocity, axis=1)).max() < 1e-15
    assert (np.cross(position, velocity)[:, 2] > 0).all()


def test_ring_orbits_balance_the_softened_pull():
    snapshot = assemble(load_scene(ring_scene(softening=0.7)))
    r = np.linalg.norm(snapshot.position[1:], axis=1)
    assert np.sum(snapshot.velocity[1:] ** 2, axis=1) / r == pytest.approx(K2 * r / (r**2 + 0.49) ** 1.5, rel=1e-13)


def test_orbits_with_ring_balance_the_pull_of_its_own_particles():
    """Averaged over seeds and angles the pull of the particles is that of the disc, up to the graininess of one spacing."""
    mass = 0.05 / 3072
    pulls, speeds = [], []
    for seed in range(4):
        snapshot = assemble(load_scene({**ring_scene(mass=mass, velocity="with_ring"), "seed": seed}))
        x, y = snapshot.position[:, :2].T
        # Particles closer to one another than half a spacing are clumps of chance, which the mean field does not have.
        squared = (x[None] - x[:, None]) ** 2 + (y[None] - y[:, None]) ** 2 + 0.024**2
        weight = snapshot.mass * squared**-1.5
        along = (x[None] - x[:, None]) * x[:, None] + (y[None] - y[:, None]) * y[:, None]
        pulls.append(-K2 * np.sum(weight * along, axis=1)[1:])
        speeds.append(np.sum(snapshot.velocity[1:] ** 2, axis=1))
    r = np.linalg.norm(snapshot.position[1:], axis=1)
    assert len(r) == 3072
    pulls, speeds = np.concatenate(pulls), np.concatenate(speeds)
    without = K2 / np.concatenate([r] * 4)
    assert np.mean(pulls) == pytest.approx(np.mean(speeds), rel=0.004)
    assert abs(np.mean(pulls) - np.mean(without)) > abs(np.mean(pulls) - np.mean(speeds))


def test_a_ring_moves_with_what_it_is_around():
    ring = {"ring": {"count": 50, "around": "planet", "inner_radius": 1, "outer_radius": 2}}
    planet = body(position=(5, 6, 7), velocity=[1, 2, 3], name="planet")
    snapshot = made([planet, ring], forces=[{"newtonian_gravity": {"strength": 0}}])
    assert snapshot.velocity[1:] == pytest.approx(np.broadcast_to([1.0, 2.0, 3.0], (50, 3)))
    assert np.mean(snapshot.position[1:, 2]) == 7.0


def test_a_ring_is_around_the_body_that_it_names_among_several():
    ring = {"ring": {"count": 50, "around": "b", "inner_radius": 1, "outer_radius": 2, "velocity": "rest"}}
    bodies = [body(name=name, position=(10 * k, 0, 0), velocity=[k, 0, 0]) for k, name in enumerate("abc")]
    snapshot = made([*bodies, ring])
    distance = np.linalg.norm(snapshot.position[3:] - [10, 0, 0], axis=1)
    assert 1.0 <= distance.min() and distance.max() <= 2.0
    assert np.array_equal(snapshot.velocity[3:], np.broadcast_to([1.0, 0.0, 0.0], (50, 3)))


def test_a_state_file_keeps_time_step_and_dt(tmp_path):
    state = replace(made([body()]), time=2.5, step=7, dt=0.125)
    state.save(tmp_path / "state.npz")
    found = Snapshot.load(tmp_path / "state.npz")
    assert (found.time, found.step, found.dt) == (2.5, 7, 0.125)


# --- determinism --------------------------------------------------------------------------------------------------------


def test_the_same_seed_gives_the_same_bits_and_another_does_not():
    first, again = (assemble(load_scene(ring_scene())) for _ in range(2))
    other = assemble(load_scene({**ring_scene(), "seed": 6}))
    assert np.array_equal(first.position, again.position) and np.array_equal(first.velocity, again.velocity)
    assert not np.array_equal(first.position, other.position)


def test_parameters_of_one_entry_do_not_change_the_random_numbers_of_another():
    small, large = {"count": 5, "inner_radius": 1, "outer_radius": 2}, {"count": 9, "inner_radius": 1, "outer_radius": 2}
    ring = {"ring": {"count": 7, "inner_radius": 3, "outer_radius": 4}}
    one, two = made([{"ring": small}, ring]), made([{"ring": large}, ring])
    assert np.array_equal(one.position[5:], two.position[9:])


# --- lattice and springs ------------------------------------------------------------------------------------------------


def sheet(**more):
    return {"lattice": {"name": "sheet", "shape": [8, 8], "lower": [-1, -1, 0], "upper": [1, 1, 0], **more}}


def test_each_particle_of_a_lattice_has_its_charge():
    assert made([sheet(charge=-0.25)]).charge.tolist() == [-0.25] * 64 and not made([sheet()]).charge.any()


def test_the_membrane_has_64_particles_112_springs_and_a_fixed_rim():
    snapshot = made([sheet(fixed="rim")], springs=[{"lattice_links": {"of": "sheet", "stiffness": 50}}])
    assert snapshot.particle_count == 64 and len(snapshot.springs) == 112
    assert snapshot.position[0].tolist() == [-1, -1, 0] and snapshot.position[63].tolist() == [1, 1, 0]
    assert snapshot.position[1] == pytest.approx([-1 + 2 / 7, -1, 0])  # x varies fastest
    rim = np.any(np.abs(snapshot.position[:, :2]) == 1.0, axis=1)
    assert (~snapshot.free[rim]).all() and snapshot.free[~rim].all() and rim.sum() == 28
    assert snapshot.springs.rest_length == pytest.approx(2 / 7)
    ends = snapshot.position[snapshot.springs.between]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1) == pytest.approx(2 / 7)
    assert len({tuple(sorted(pair)) for pair in snapshot.springs.between.tolist()}) == 112


def test_displacement_moves_particles_but_not_the_springs_rest():
    moved = sheet(displacement=[0, 0, "0.1 * sin(pi * u) * sin(2 * pi * v)"])
    snapshot = made([moved], springs=[{"lattice_links": {"of": "sheet", "stiffness": 50, "prestretch": 1.5}}])
    x, y, z = snapshot.position.T
    assert z == pytest.approx(0.1 * np.sin(np.pi * (x + 1) / 2) * np.sin(2 * np.pi * (y + 1) / 2))
    assert snapshot.springs.rest_length == pytest.approx(2 / 7 / 1.5)


@pytest.mark.parametrize("shape, springs", [([5], 4), ([4, 3], 17), ([3, 3, 3], 54), ([1, 1, 1], 0), ([1, 6], 5)])
def test_links_of_chains_sheets_and_blocks(shape, springs):
    entry = {"lattice": {"name": "l", "shape": shape, "lower": [0, 0, 0], "upper": [1, 2, 3]}}
    spec = load_scene(scene([body(), entry], springs=[{"lattice_links": {"of": "l", "stiffness": 1}}]))
    snapshot = assemble(spec)
    assert len(snapshot.springs) == estimate(spec).spring_count == springs
    if springs:
        assert snapshot.springs.between.min() == 1
        difference = snapshot.position[snapshot.springs.between[:, 1]] - snapshot.position[snapshot.springs.between[:, 0]]
        assert (np.count_nonzero(difference, axis=1) == 1).all()


def test_links_by_name_index_and_group():
    named = {"between": ["sun", "sheet[9]"], "stiffness": 1}
    links = [{"link": named}, {"link": {"between": [3, 1], "stiffness": 2, "rest_length": 0}}]
    snapshot = made([body(name="sun"), sheet()], springs=links)
    assert snapshot.springs.between.tolist() == [[0, 10], [3, 1]]
    assert snapshot.springs.rest_length[0] == pytest.approx(np.linalg.norm(snapshot.position[10]))
    assert snapshot.springs.rest_length[1] == 0.0


# --- files --------------------------------------------------------------------------------------------------------------


def file_scene(tmp_path, name, **changes):
    text = f"particles:\n  - file: {{path: {name}}}\nintegrator: {{leapfrog: {{dt: 1}}}}\n"
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    return load_scene(path, overrides=changes)


def test_particles_from_npz(tmp_path):
    position, mass = np.arange(12.0).reshape(4, 3), np.arange(1, 5)
    np.savez(tmp_path / "c.npz", position=position, mass=mass, name=np.array(["a", "b", "c", "d"]), free=np.ones((4, 3), bool))
    spec = file_scene(tmp_path, "c.npz")
    snapshot = assemble(spec)
    assert estimate(spec).particle_count == 4
    assert np.array_equal(snapshot.position, position) and snapshot.mass.tolist() == [1, 2, 3, 4]
    assert snapshot.name == ("a", "b", "c", "d") and not snapshot.velocity.any()


def test_a_snapshot_of_a_run_can_be_read_again(tmp_path):
    first = made([body(name="a", charge=2), body(2, (1, 2, 3), velocity=[4, 5, 6])])
    first.save(tmp_path / "state.npz")
    again = assemble(file_scene(tmp_path, "state.npz"))
    for key in ("position", "velocity", "mass", "radius", "charge", "color", "free"):
        assert np.array_equal(getattr(first, key), getattr(again, key))
    assert first.name == again.name


def test_particles_from_csv(tmp_path):
    (tmp_path / "c.csv").write_text("name,mass,position_x,position_y,velocity_z\na,1,2,3,4\nb,1e-3,.5,-1,0\n\n")
    spec = file_scene(tmp_path, "c.csv")
    snapshot = assemble(spec)
    assert estimate(spec).particle_count == 2
    assert snapshot.position.tolist() == [[2, 3, 0], [0.5, -1, 0]]
    assert snapshot.velocity.tolist() == [[0, 0, 4], [0, 0, 0]] and snapshot.name == ("a", "b")


GOOD_ARRAYS = {"position": np.zeros((2, 3)) + [[0, 0, 0], [1, 0, 0]], "mass": np.ones(2)}
BROKEN_ARRAYS = {
    "wrong shape": ({**GOOD_ARRAYS, "velocity": np.zeros((2, 2))}, "velocity has the shape (2, 2), must be (2, 3)"),
    "not finite": ({**GOOD_ARRAYS, "mass": np.array([1.0, np.nan])}, "mass of particle 1 is not a finite number"),
    "pickled": ({**GOOD_ARRAYS, "mass": np.array([1, None])}, "Python objects"),
    "text": ({**GOOD_ARRAYS, "mass": np.array(["a", "b"])}, "mass must hold numbers"),
    "complex": ({**GOOD_ARRAYS, "mass": np.ones(2, complex)}, "mass must hold numbers"),
    "no position": ({"mass": np.ones(2)}, "has no position"),
    "no mass": ({"position": np.zeros((2, 3))}, "has no mass"),
    "no particles": ({"position": np.zeros((0, 3)), "mass": np.zeros(0)}, "holds no particles"),
    "a number": ({"position": np.zeros(3), "mass": np.float64(1)}, "holds no particles"),
    "color": ({**GOOD_ARRAYS, "color": np.full((2, 3), 2.0)}, "color must lie in 0…1"),
    "names": ({**GOOD_ARRAYS, "name": np.array([1, 2])}, "name must be 2 texts"),
}


@pytest.mark.parametrize("name", BROKEN_ARRAYS)
def test_a_broken_npz_is_refused_at_the_entry(name, tmp_path):
    arrays, message = BROKEN_ARRAYS[name]
    np.savez(tmp_path / "c.npz", **arrays)
    with pytest.raises(SceneError) as caught:
        assemble(file_scene(tmp_path, "c.npz"))
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path / 'scene.yaml'}:2:5: ")


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "empty"),
        ("mass,position_x\n", "holds no particles"),
        ("mass,mass\n1,2\n", "twice"),
        ("mass,weight\n1,2\n", "unknown column 'weight'"),
        ("mass,position_x\n1\n", "row 2 has 1 entries"),
        ("mass,position_x\n1,abc\n", "could not convert"),
        ("mass,position_x\n1,nan\n", "not a finite number"),
        ("mass,position_x\n1,inf\n", "not a finite number"),
        ("position_x\n1\n", "has no mass"),
        ("mass\n1\n", "has no position"),
        ('mass,position_x\n1,"2\n', "not a table"),
    ],
)
def test_a_broken_csv_is_refused(text, message, tmp_path):
    (tmp_path / "c.csv").write_text(text)
    with pytest.raises(SceneError, match=message):
        assemble(file_scene(tmp_path, "c.csv"))


def test_files_that_are_no_archives_are_refused(tmp_path):
    for data in (b"", b"PK\x03\x04", b"hello"):
        (tmp_path / "c.npz").write_bytes(data)
        with pytest.raises(SceneError, match="npz"):
            assemble(file_scene(tmp_path, "c.npz"))
    np.savez(tmp_path / "c.npz", **GOOD_ARRAYS)
    data = (tmp_path / "c.npz").read_bytes()
    for cut in range(10, len(data), 37):
        (tmp_path / "c.npz").write_bytes(data[:cut])
        with pytest.raises(SceneError):
            assemble(file_scene(tmp_path, "c.npz"))


@pytest.mark.parametrize("write", [np.savez, np.savez_compressed])
def test_a_damaged_archive_is_particles_or_a_fault(write, tmp_path):
    write(tmp_path / "c.npz", **GOOD_ARRAYS, name=np.array(["a", "b"]))
    data, random = (tmp_path / "c.npz").read_bytes(), np.random.default_rng(1)
    spec = file_scene(tmp_path, "c.npz")
    refused = 0
    for _ in range(300):
        damaged = bytearray(data)
        for place in random.integers(0, len(data), random.integers(1, 6)):
            damaged[place] = random.integers(0, 256)
        (tmp_path / "c.npz").write_bytes(damaged)
        try:
            assemble(spec)
        except SceneError as error:
            refused += 1
            assert all("\n" not in fault for fault in error.faults)
    assert refused > 100


def test_an_archive_that_unpacks_to_more_than_the_machine_has_is_refused_unread(tmp_path):
    import io
    import zipfile

    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
    with zipfile.ZipFile(tmp_path / "c.npz", "w") as archive:
        archive.writestr("mass.npy", header.getvalue())
    spec = file_scene(tmp_path, "c.npz")
    with pytest.raises(CapacityError, match="1000000000000 particles"):
        check_capacity(estimate(spec))
    with pytest.raises(SceneError, match="more than"):
        assemble(spec)


def test_a_link_that_leads_out_of_the_folder_is_refused(tmp_path):
    inside = tmp_path / "inside"
    inside.mkdir()
    np.savez(tmp_path / "c.npz", **GOOD_ARRAYS)
    (inside / "c.npz").symlink_to(tmp_path / "c.npz")
    with pytest.raises(SceneError, match="outside the scene's folder"):
        file_scene(inside, "c.npz")


# --- physics ------------------------------------------------------------------------------------------------------------


def entries_with(parameter):
    """Every generator that takes a number of this name."""
    found = [name for name in component.names("generators") if any(p.name == parameter for p in parameters_of(name))]
    assert len(found) > 3
    return found


def parameters_of(generator):
    return component.declaration("generators", generator).parameters


@pytest.mark.parametrize("parameter", ["mass", "radius"])
def test_no_generator_takes_a_mass_or_a_radius_below_zero(parameter):
    for name in entries_with(parameter):
        with pytest.raises(SceneError) as caught:
            made([{name: {parameter: -1.0}}])
        assert any(f"particles[0].{name}.{parameter}: -1 is not allowed, must be" in fault for fault in caught.value.faults)


def test_a_mass_below_zero_is_one_located_error_and_the_exit_code_is_2(tmp_path, capsys):
    path = tmp_path / "anti.yaml"
    path.write_text("particles:\n  - body: {mass: -3e-6, position: [0, 0, 0]}\n  - body: {mass: 1, position: [1, 0, 0]}\n")
    assert main(["check", str(path)]) == 2
    said = capsys.readouterr().err
    assert f"{path}:2:18: particles[0].body.mass: -3e-06 is not allowed, must be at least 0" in said
    assert said.count("must be") == 1
    path.write_text(path.read_text().replace("-3e-6", "1"))
    assert main(["run", str(path), "--dry-run", "--set", "particles[1].body.mass=-1"]) == 2
    assert "particles[1].body.mass: -1 is not allowed, must be at least 0" in capsys.readouterr().err


def test_a_timeline_gives_no_mass_below_zero():
    with pytest.raises(SceneError, match=r"particles\[0\].body.mass: -1 is not allowed, must be at least 0"):
        load_scene(scene([body(1)], timeline=[{"at": 1, "set": {"particles[0].body.mass": -1}}], run={"duration": 2}))


@pytest.mark.parametrize("key", ["mass", "radius"])
def test_a_file_of_particles_holds_no_mass_or_radius_below_zero(tmp_path, key):
    count = len(GOOD_ARRAYS["mass"])
    values = np.ones(count)
    values[1] = -2.0
    np.savez(tmp_path / "below.npz", **{**GOOD_ARRAYS, key: values})
    with pytest.raises(SceneError, match=f"below.npz: {key} of particle 1 is -2, must be at least 0"):
        assemble(file_scene(tmp_path, "below.npz"))


def test_a_snapshot_with_a_mass_below_zero_is_no_start(tmp_path):
    start = made([body(1), body(2, (1, 0, 0))])
    below = replace(start, mass=np.array([-1.0, 2.0]))
    below.save(tmp_path / "below.npz")
    with pytest.raises(OutputError, match="mass of particle 0 is below 0"):
        Snapshot.load(tmp_path / "below.npz")
    with pytest.raises(StateError, match="below 0"):
        replace(below, merged_into=np.full(2, -1)).continuing(replace(start, mass=below.mass, merged_into=np.full(2, -1)))


@pytest.mark.parametrize(
    "more, message",
    [
        ({"forces": [{"newtonian_gravity": {}}, {"uniform_gravity": {}}]}, None),
        ({"forces": [{"coulomb": {}}]}, None),
        ({"forces": [{"linear_drag": {"coefficient": 1}}]}, "must have one above 0 where linear_drag acts"),
        ({"springs": [{"link": {"between": [0, 1], "stiffness": 1}}]}, "has no mass but a spring"),
    ],
)
def test_test_particles_without_mass(more, message):
    particles = [body(), body(0, (1, 0, 0))]
    if message is None:
        assert made(particles, **more).mass[1] == 0
    else:
        with pytest.raises(SceneError, match=message):
            made(particles, **more)


def test_a_charged_particle_needs_a_mass():
    with pytest.raises(SceneError, match="has a charge but no mass"):
        made([body(charge=1), body(0, (1, 0, 0), charge=1)], forces=[{"coulomb": {}}])


def test_a_fixed_anchor_needs_no_mass():
    made([body(0, free=False), body(1, (1, 0, 0))], springs=[{"link": {"between": [0, 1], "stiffness": 1}}])


@pytest.mark.parametrize(
    "particles, forces, refused",
    [
        ([body(), body()], [{"newtonian_gravity": {}}], True),
        ([body(), body()], [{"newtonian_gravity": {"softening": 0.1}}], False),
        ([body(), body()], [{"newtonian_gravity": {"strength": 0}}], False),
        ([body(), body()], [{"coulomb": {}}], False),
        ([body(0), body(1)], [{"newtonian_gravity": {}}], True),
        ([body(0), body(0)], [{"newtonian_gravity": {}}], False),
        ([body(charge=1), body(charge=-1)], [{"coulomb": {}}], True),
        ([body(charge=1), body(charge=0)], [{"coulomb": {}}], False),
        ([body(), body(1, (0, -0.0, 0))], [{"newtonian_gravity": {}}], True),
        ([body(), body(1, (1e-300, 0, 0))], [{"newtonian_gravity": {}}], False),
        ([body(0), body(0), body(1)], [{"newtonian_gravity": {}}], True),
        ([body(charge=1), body(charge=0), body(charge=1)], [{"coulomb": {}}], True),
    ],
)
def test_particles_in_one_place(particles, forces, refused):
    if refused:
        with pytest.raises(SceneError, match=r"particle \d .* is where particle \d"):
            made(particles, forces=forces)
    else:
        made(particles, forces=forces)


def test_coincidences_among_a_hundred_thousand_are_found_quickly(tmp_path):
    position = np.random.default_rng(0).normal(size=(100_000, 3))
    position[77_777] = position[123]
    np.savez(tmp_path / "c.npz", position=position, mass=np.ones(100_000))
    spec = file_scene(tmp_path, "c.npz", **{"+forces": [{"newtonian_gravity": {}}]})
    with pytest.raises(SceneError, match=r"particle 77777 \(file\[77777\]\) is where particle 123 "):
        assemble(spec)


def test_the_center_of_mass_can_be_put_to_rest_at_the_origin():
    pair = [body(1, (1, 2, 3), velocity=[1, 0, 0]), body(3, (5, 6, 7), velocity=[0, 2, 0])]
    snapshot = made(pair, move_to_center_of_mass=True)
    assert snapshot.mass @ snapshot.position == pytest.approx([0, 0, 0], abs=1e-14)
    assert snapshot.mass @ snapshot.velocity == pytest.approx([0, 0, 0], abs=1e-14)
    assert snapshot.position[1] - snapshot.position[0] == pytest.approx([4, 4, 4])
    in_plane = [{"body": {**entry["body"], "position": [k, 0, 2], "free": [True, True, False]}} for k, entry in enumerate(pair)]
    assert made(in_plane, move_to_center_of_mass=True).position.tolist() == [[-0.75, 0, 0], [0.25, 0, 0]]
    for bad in ([body(free=False), body(1, (1, 0, 0))], [in_plane[0], pair[1]], [body(0)]):
        with pytest.raises(SceneError, match="move_to_center_of_mass"):
            made(bad, move_to_center_of_mass=True)


# --- capacity -----------------------------------------------------------------------------------------------------------


def test_the_estimate_counts_pairs_only_where_a_pair_force_acts():
    without, with_gravity = (load_scene(scene([sheet()], forces=forces)) for forces in ([], [{"newtonian_gravity": {}}]))
    assert estimate(without).pair_interactions_per_evaluation == 0
    assert estimate(with_gravity).pair_interactions_per_evaluation == 64 * 63


def test_the_estimate_counts_pairs_within_the_cutoff_in_a_periodic_box():
    force = {"lennard_jones": {"strength": 1, "length": 1, "cutoff": 2.0}}
    box = {"periodic_box": {"lower": [0, 0, 0], "upper": [10, 10, 10]}}
    gas = {"gas": {"count": 500, "lower": [0, 0, 0], "upper": [10, 10, 10], "radius": 0, "mass": 1, "speed": 1}}
    found = estimate(load_scene(scene([gas], forces=[force], walls=[box])))
    share = 4 / 3 * np.pi * 2.0**3 / 1000
    assert found.pair_interactions_per_evaluation == round(500 * 499 * share)


@pytest.mark.parametrize("duration, dt, steps", [(1, 0.1, 10), (1, 0.3, 4), (0.3, 0.1, 3), (365.25, 0.03, 12175), (1, 1, 1)])
def test_the_estimate_counts_whole_steps(duration, dt, steps):
    spec = load_scene(scene([body()], run={"duration": duration}, integrator={"leapfrog": {"dt": dt}}))
    assert estimate(spec).steps == steps


@pytest.mark.parametrize(
    "needed, message",
    [
        (Estimate(2**31, 0, 1, 0, 1), "2147483648 particles"),
        (Estimate(1, 2**31, 1, 0, 1), "2147483648 springs"),
        (Estimate(1, 0, 2**60, 0, 1), "GiB"),
        (Estimate(1, 0, 1, 0, 10**9 + 1), "steps, allowed"),
    ],
)
def test_too_much_is_refused_with_the_numbers(needed, message):
    with pytest.raises(CapacityError, match=message):
        check_capacity(needed)
    assert CapacityError.exit_code == 6


def test_the_memory_estimate_is_above_what_assembly_takes():
    import tracemalloc

    spec = load_scene(scene([{"ring": {"count": 20_000, "inner_radius": 1, "outer_radius": 2, "velocity": "rest"}}]))
    tracemalloc.start()
    assemble(spec)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 0.2 * estimate(spec).bytes < peak < estimate(spec).bytes
