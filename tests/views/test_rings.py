"""Rings around bodies: their place, what shines through them, how they are lit, and their shadows."""

import math
from dataclasses import replace

import numpy as np
import pytest
from function_values import function_values
from pictures import FRONT, SCENE_WITH_VIEW, draw, frame_of, view_spec
from PIL import Image

from mpp_taichi.device import backends
from mpp_taichi.errors import SceneError
from mpp_taichi.scene.body_view_spec import (
    BodyViewSpec,
    CloudsSpec,
    NightSpec,
    NormalSpec,
    RingSpec,
    RingTextureSpec,
    SpinSpec,
    TextureSpec,
)
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.view_spec import CameraSpec, LightSpec
from mpp_taichi.views import renderer, rings
from mpp_taichi.views._rings import scattered
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.srgb import linear_from_srgb

SIZE = (160, 160)
PARALLEL = replace(FRONT, projection="orthographic", height=8.0)  # 20 pixels a length
AWAY = (LightSpec(direction=(0, 0, 1), brightness=0.0),)  # no light at all
COLORED = 1.0 + 1e-9  # a brightness other than 1, so that all pictures here have one kernel
RING = RingSpec(inner=1.5, outer=3.0, color=(1.0, 1.0, 1.0), opacity=0.5)
ROUNDED = 0.006  # of light, by the 255 displayed values


@pytest.fixture(autouse=True)
def fresh_runtime():
    """Not after each test here: all draw with the kernels of one runtime."""
    return


@pytest.fixture(scope="module")
def cpu():
    """One backend for all pictures here; double precision, which pictures must not notice."""
    backends.start("cpu", "f64")
    yield
    backends.stop()


def _light(ring: RingSpec | None, axis=(0.0, 0.0, 1.0), camera=PARALLEL, **others) -> np.ndarray:
    body = BodyViewSpec(ring=ring, spin=SpinSpec(period=1.0, axis=axis))
    spec = view_spec(camera, bodies={(0, 1): body}, **{"ambient": 0.0, **others})
    return linear_from_srgb(draw(frame_of([0, 0, 0], 1.0), spec, SIZE) / 255.0)[:, :, 1]


def _at(light: np.ndarray, x: float, y: float) -> float:
    return float(light[round(79.5 - 20 * y), round(79.5 + 20 * x)])


@pytest.mark.sampled(3)
def test_a_ring_lets_light_pass_by_its_opacity_and_its_slant(cpu) -> None:
    white = (1.0, 1.0, 1.0)
    face_on = _light(RING, light=AWAY, background=white)
    for x, expected in ((0.0, 0.0), (1.2, 1.0), (1.7, 0.5), (2.8, 0.5), (3.3, 1.0)):
        assert _at(face_on, x, 0.0) == pytest.approx(expected, abs=ROUNDED), x
    slanted = _light(RING, axis=(0.0, math.sqrt(0.75), 0.5), light=AWAY, background=white)
    assert _at(slanted, 2.2, 0.0) == pytest.approx(0.25, abs=ROUNDED), "twice the way through the ring"
    assert _at(slanted, 0.0, 1.25) == pytest.approx(0.25, abs=ROUNDED) and _at(slanted, 0.0, 1.6) == 1.0, "half as high"
    assert _at(slanted, 0.0, -0.85) == pytest.approx(0.0, abs=ROUNDED), "before the planet, which is black"


def test_the_planet_hides_the_ring_behind_it_and_the_ring_the_planet_behind_it(cpu) -> None:
    axis = (0.0, math.sqrt(0.75), 0.5)  # the nearer half of the ring is below the middle of the picture
    bare = _light(None, axis, light=(LightSpec(direction=(0, 0, 1), brightness=COLORED),))
    ringed = _light(
        replace(RING, opacity=0.9, color=(0, 0, 0)), axis, light=(LightSpec(direction=(0, 0, 1), brightness=COLORED),)
    )
    assert _at(ringed, 0.0, 0.9) == pytest.approx(_at(bare, 0.0, 0.9), abs=ROUNDED)
    assert _at(ringed, 0.0, -0.9) < 0.05 * _at(bare, 0.0, -0.9)


def test_light_scattered_in_a_ring_is_the_sum_over_its_depth(cpu) -> None:
    cases = [(d, e, s) for d in (0.05, 0.8, 6.0) for e in (0.2, 0.7) for s in (0.2, 0.45, 0.7, -0.2, -0.45, -0.7)]
    found = function_values(scattered, cases)
    expected = []
    for d, e, s in cases:
        t = (np.arange(4000) + 0.5) / 4000 * d
        arrives = np.exp(-t / abs(s))
        leaves = np.exp(-(t if s > 0 else d - t) / e)
        expected.append(2.0 * (arrives * leaves).sum() * d / 4000 / e)
    # The midpoint sum is right to (d/4000)²/24 (1/μ + 1/μ₀)², 1e-5. Equal cosines are taken apart by 1e-3, which changes the
    # light that passes by τ/(2 μ²) times as much: the bound is twice that, 1e-3 τ/μ² of itself.
    rough = np.array([1e-3 * d / (e * e) if abs(abs(s) - e) < 1e-6 else 0.0 for d, e, s in cases])
    assert (np.abs(found - expected) < (1e-4 + rough) * np.array(expected) + 2e-5).all()


def test_the_planet_casts_its_shadow_on_the_ring(cpu) -> None:
    toward = np.array([0.96, 0.0, 0.28])
    light = _light(RING, light=(LightSpec(direction=tuple(toward), angular_radius=0.01, brightness=COLORED),))
    lit = 2.0 * 0.28 / 1.28 * (1.0 - 0.5 ** (1.0 + 1.0 / 0.28))  # seen along the axis, with the optical depth ln 2
    counted = [0, 0]
    for x, y in [(x, y) for x in np.arange(-2.875, 3.0, 0.25) for y in np.arange(-2.875, 3.0, 0.25)]:
        if not 1.6 < math.hypot(x, y) < 2.9:
            continue
        along = float(toward[0] * x)
        aside = math.sqrt(x * x + y * y - along * along)
        if abs(aside - 1.0) > 0.06:  # a pixel away from the edge of the shadow
            dark = along < 0.0 and aside < 1.0
            assert _at(light, x, y) == pytest.approx(0.0 if dark else lit, abs=ROUNDED), (x, y)
            counted[dark] += 1
    assert min(counted) > 10


def test_the_ring_casts_its_shadow_on_the_planet(cpu) -> None:
    axis, toward = (0.0, 1.0, 0.0), np.array([0.28, 0.6, 0.75])  # the camera sees the ring from its edge
    toward /= np.linalg.norm(toward)
    sun = (LightSpec(direction=tuple(toward), angular_radius=0.01, brightness=COLORED),)
    near = replace(PARALLEL, height=2.4)
    bare, ringed = _light(None, axis, near, light=sun), _light(RING, axis, near, light=sun)
    counted = [0, 0]
    for row in range(82, 150):
        for column in range(30, 130, 7):
            x, y = (column + 0.5 - 80) * 2.4 / 160, (80 - row - 0.5) * 2.4 / 160
            if x * x + y * y > 0.9 or bare[row, column] < 0.1:
                continue
            point = np.array([x, y, math.sqrt(1.0 - x * x - y * y)])
            crossing = point - toward * (y / toward[1])
            radius = math.hypot(crossing[0], crossing[2])
            if min(abs(radius - 1.5), abs(radius - 3.0)) > 0.12:  # some pixels away from the edge
                share = 0.5 ** (1.0 / toward[1]) if 1.5 < radius < 3.0 else 1.0
                assert ringed[row, column] == pytest.approx(share * bare[row, column], abs=2 * ROUNDED), (x, y)
                counted[int(share < 1.0)] += 1
    assert min(counted) > 10


def test_bands_of_a_ring_are_those_of_its_picture(cpu, tmp_path) -> None:
    picture = np.zeros((4, 64, 4), np.uint8)
    picture[:, :16], picture[:, 48:] = (255, 255, 255, 255), (255, 255, 255, 51)
    Image.fromarray(picture).save(tmp_path / "bands.png")
    ring = RingSpec(inner=1.0, outer=3.0, texture=RingTextureSpec(file=str(tmp_path / "bands.png")))
    through = _light(ring, light=AWAY, background=(1.0, 1.0, 1.0))
    # An opacity of 0.998 is the largest; 51/255 is a fifth.
    for x, expected in ((1.25, 0.002), (2.0, 1.0), (2.75, 0.8)):
        assert _at(through, x, 0.0) == pytest.approx(expected, abs=ROUNDED), x
    Image.fromarray(picture[..., 3]).save(tmp_path / "grey.png")
    grey = RingSpec(inner=1.0, outer=3.0, texture=RingTextureSpec(file=str(tmp_path / "grey.png")), opacity=0.5)
    assert _at(_light(grey, light=AWAY, background=(1.0, 1.0, 1.0)), 2.75, 0.0) == pytest.approx(0.9, abs=ROUNDED)


def test_patterns_of_rings_have_bands_and_gaps() -> None:
    from mpp_taichi.views.ring_patterns import ring_profile

    saturn = ring_profile("saturn", 0, (0.9, 0.8, 0.6), 1024)[:, 3]

    def mean(first: float, last: float) -> float:
        """The mean opacity between two radii in km."""
        place = 74_658 + (np.arange(1024) + 0.5) / 1024 * (136_775 - 74_658)
        return float(saturn[(place > first) & (place < last)].mean())

    c, b, division, a, encke = (
        mean(*each) for each in ((75e3, 91e3), (100e3, 117e3), (118e3, 122e3), (123e3, 133e3), (133_450, 133_730))
    )
    assert b > a > c and a > 3 * division and encke < 0.02
    bands = ring_profile("bands", 5, (0.9, 0.8, 0.6), 1024)
    assert bands[:, 3].std() > 0.1 and (bands != ring_profile("bands", 6, (0.9, 0.8, 0.6), 1024)).any()
    assert ((bands >= 0.0) & (bands <= 1.0)).all()


def test_no_part_of_a_ring_is_missed_by_the_tiles(cpu, monkeypatch: pytest.MonkeyPatch) -> None:
    cameras = [
        CameraSpec(position=(0, -6, 2), look_at=(1.5, 0, 0), up=(0, 0, 1)),
        CameraSpec(position=(0, -2.5, 0.3), look_at=(2.5, -1.0, 0), up=(0, 0, 1)),  # within the outer radius
        replace(PARALLEL, height=6.1),  # the ring touches the edges of the picture
    ]
    light = (LightSpec(direction=(-1, -1, 1), brightness=COLORED),)
    drawn = [_light(RING, camera=camera, light=light) for camera in cameras]
    monkeypatch.setattr(
        renderer, "tiles_with_rings", lambda table, screen: np.ones(screen.tiles_across * screen.tiles_down, bool)
    )
    for camera, picture in zip(cameras, drawn, strict=True):
        np.testing.assert_array_equal(_light(RING, camera=camera, light=light), picture)
        assert (picture > 0.05).mean() > 0.02


SCENE = SCENE_WITH_VIEW.replace("VIEW", "bodies: {moon: {ring: RING}}")


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("ring", "fault"),
    [
        ("{inner: 2, outer: 2}", ":8:43: view.bodies.moon.ring.outer: must be above inner, which is 2"),
        ("{inner: 0.5, outer: 2}", ":8:33: view.bodies.moon.ring.inner: 0.5 is not allowed, must be at least 1"),
        ("{inner: 1.2}", ":8:19: view.bodies.moon.ring: missing key 'outer'"),
        ("{inner: 1.2, outer: 2, texture: {pattern: saturnn}}", "did you mean 'saturn'?"),
        ("{inner: 1.2, outer: 2, texture: {}}", "view.bodies.moon.ring.texture: must have a file or a pattern"),
        ("{inner: 1.2, outer: 2, texture: {file: none.png}}", ":8:64: view.bodies.moon.ring.texture.file: there is no file"),
        ("{inner: 1.2, outer: 2}, light: true", ":8:25: view.bodies.moon.ring: is not for a body that shines"),
    ],
)
def test_faults_of_a_ring_are_told_with_their_place(tmp_path, ring: str, fault: str) -> None:
    (tmp_path / "scene.yaml").write_text(SCENE.replace("RING", ring), encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        load_scene(tmp_path / "scene.yaml")
    assert fault in str(caught.value), caught.value


# Last, since these start runtimes of their own


def _with_everything():
    """A planet with all maps and a ring, and a moon, under two lights."""
    planet = BodyViewSpec(
        texture=TextureSpec(pattern="coasts"),
        night=NightSpec(pattern="cities"),
        clouds=CloudsSpec(pattern="scattered", period=3.0),
        normal=NormalSpec(pattern="mountains"),
        ring=RingSpec(inner=1.3, outer=2.3, texture=RingTextureSpec(pattern="bands")),
        spin=SpinSpec(period=8.0, axis=(0.3, 0.9, 0.4)),
    )
    lights = (LightSpec(direction=(1, 0.6, 0.3)), LightSpec(direction=(-1, 0.5, -0.4), color=(1.0, 0.5, 0.2), brightness=0.5))
    camera = CameraSpec(position=(0, 2, 9), look_at=(0, 0, 0), up=(0, 1, 0))
    frame = frame_of([[0, 0, 0], [2.2, 1.4, 0.7]], [1.4, 0.3], [(0.2, 0.3, 0.6), (0.8, 0.8, 0.8)], time=1.0)
    return frame, view_spec(camera, bodies={(0, 1): planet}, light=lights)


@pytest.mark.sampled(3)
def test_all_parts_of_a_picture_are_the_same_on_vulkan(cpu, software_vulkan) -> None:
    """CPUs draw by rows and here in a runtime of double precision, Vulkan by pixels and in single precision."""
    frame, spec = _with_everything()
    ours = draw(frame, spec, SIZE).astype(int)
    backends.stop()
    backends.start("vulkan", "f32")
    theirs = draw(frame, spec, SIZE).astype(int)
    assert ours.max() > 150
    assert (np.abs(ours - theirs).max(axis=2) > 3).mean() < 2e-3, "but for single samples at edges"


def test_a_view_without_rings_compiles_none(monkeypatch: pytest.MonkeyPatch) -> None:
    from mpp_taichi.views import _pixel_light, _surface_shading

    def not_here(*_: object) -> None:
        raise AssertionError("compiled")

    monkeypatch.setattr(_pixel_light, "through_rings", not_here)
    monkeypatch.setattr(_surface_shading, "share_through_rings", not_here)
    backends.start("cpu", "f32")
    try:
        assert _light(None, light=(LightSpec(direction=(1, 0, 0)),)).max() > 0.0
        with pytest.raises(Exception, match="compiled"):
            _light(RING)
    finally:
        backends.stop()
    assert rings.tiles_with_rings(np.zeros((0, 9), np.float32), rings.Screen(160, 160, 1.0, True)).sum() == 0


def test_rings_are_drawn_from_the_farthest_on_and_at_one_distance_in_the_order_of_the_bodies():
    """Three distances, each of ten bodies; a row says whose ring it is by its first texel, and texels follow the bodies."""
    depth = np.random.default_rng(2).permutation(np.repeat([1.0, 2.0, 3.0], 10))
    center = np.stack([np.linspace(-1.0, 1.0, 30), np.zeros(30), depth], axis=1)
    spec = view_spec(PARALLEL, bodies={(k, 1): BodyViewSpec(ring=RING) for k in range(30)})
    camera = Camera(spec.camera, frame_of([0, 0, 0], 1.0), aspect=1.0)
    rows = rings.Rings(spec).rows(0.0, camera, center, np.full(30, 0.1))
    order = np.argsort(np.argsort(rows[:, -1]))
    assert order.tolist() == sorted(range(30), key=lambda k: (-depth[k], k))
