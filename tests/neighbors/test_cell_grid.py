"""The cell grid finds the pairs of a search over all pairs, each once, in an order that is independent of threads."""

import hashlib

import numpy as np
import pytest
import taichi as ti

from mpp_taichi.device import backends
from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.neighbors.device_grid import DeviceGrid
from mpp_taichi.neighbors.partner_list import PARTNERS_PER_SPHERE, PartnerList
from mpp_taichi.neighbors.plain_rows import is_plain


@ti.data_oriented
class Finder:
    """All pairs that a grid shows."""

    def __init__(self, position, reach, skin=0.0, **where):
        real = np.float32 if ti.lang.impl.current_cfg().default_fp == ti.f32 else np.float64
        n, d = position.shape
        self.count = n
        self.position, self.reach = ti.Vector.field(d, float, shape=n), ti.field(float, shape=n)
        self.capacity = 400 * n
        self.pairs = ti.Vector.field(2, ti.i32, shape=self.capacity)
        self.found = ti.field(ti.i32, shape=())
        self.grid = CellGrid(n, d, **where)
        self.partners = PartnerList(self.grid)
        self.position.from_numpy(position.astype(real))
        self.reach.from_numpy(reach.astype(real))
        self.grid.build(self.position, self.reach, skin=skin)

    @ti.kernel
    def _find_once(self, where: ti.template()):
        self.found[None] = 0
        for slot in range(self.count):
            where.visit_later(slot, self._note, 0.0, 0.0)

    @ti.kernel
    def _find_twice(self, where: ti.template()):
        self.found[None] = 0
        for slot in range(self.count):
            where.visit(slot, self._note, 0.0, 0.0)

    @ti.func
    def _note(self, slot, other, _, __):
        k = ti.atomic_add(self.found[None], 1)
        if k < self.capacity:
            self.pairs[k] = ti.Vector([self.grid.order[slot], self.grid.order[other]])

    def once(self, where=None):
        self._find_once(where or self.grid)
        assert self.found[None] <= self.capacity
        return sorted(map(tuple, np.sort(self.pairs.to_numpy()[: self.found[None]], axis=1).tolist()))

    def twice(self, where=None):
        self._find_twice(where or self.grid)
        assert self.found[None] <= self.capacity
        return sorted(tuple(pair) for pair in self.pairs.to_numpy()[: self.found[None]].tolist() if pair[0] != pair[1])


def brute_force(position, reach, period=None):
    i, j = np.triu_indices(len(position), 1)
    d = position[j] - position[i]
    if period is not None:
        edges = np.asarray(period)[: d.shape[1]]
        wraps = edges > 0
        d[:, wraps] -= edges[wraps] * np.round(d[:, wraps] / edges[wraps])
    near = (d * d).sum(1) <= (reach[i] + reach[j]) ** 2
    return list(zip(i[near].tolist(), j[near].tolist(), strict=True))


def uniform(random, n, d, ratio):
    """Reaches evenly spread in their logarithm, so that every level of the grid is in use; the largest a tenth of the box."""
    return random.uniform(-3.0, 7.0, (n, d)), ratio ** random.uniform(-1.0, 0.0, n)


def few_huge(random, n, d, ratio):
    position, reach = random.uniform(0.0, 10.0, (n, d)), np.full(n, 3.0 / ratio)
    reach[:3] = 3.0
    return position, reach


def cluster_far_from_one(random, n, d, ratio):
    """A dense cluster, and one sphere so far away that a grid over both would be one cell for the cluster."""
    position = random.normal(size=(n, d))
    position[0] = 1e5
    return position, np.full(n, 0.2) * ratio ** random.uniform(-0.2, 0.0, n)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("scene", [uniform, few_huge, cluster_far_from_one])
def test_pairs_are_those_of_brute_force(scene, dimensions):
    backends.start("cpu", "f64", threads=2)
    position, reach = scene(np.random.default_rng(5), 700, dimensions, 1e4)
    finder = Finder(position, reach)
    expected = brute_force(position, reach)
    assert len(expected) > 100
    assert finder.once() == expected
    assert finder.twice() == sorted(expected + [(j, i) for i, j in expected])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("ratio", [1.0, 30.0, 1e4])
@pytest.mark.parametrize("dimensions", [2, 3])
def test_pairs_of_a_box_that_repeats(dimensions, ratio):
    """Positions lie in several images of the box; one axis does not repeat. Twice the largest reach is below half a period."""
    backends.start("cpu", "f64", threads=2)
    random = np.random.default_rng(6)
    position = random.uniform(-20.0, 30.0, (500, dimensions))
    reach = (0.6 if ratio == 1.0 else 1.9) * ratio ** random.uniform(-1.0, 0.0, 500)
    period = (8.0, 0.0, 9.0)
    finder = Finder(position, reach, period=period, origin=(-1.0, 0.0, 2.0))
    expected = brute_force(position, reach, period)
    assert len(expected) > 100
    assert finder.once() == expected


@pytest.mark.parametrize("ratio", [1.0, 1e4])
@pytest.mark.sampled(3)
def test_partners_that_are_written_down_are_those_within_the_skins(ratio):
    backends.start("cpu", "f64", threads=2)
    random = np.random.default_rng(6)
    position = random.uniform(-20.0, 30.0, (500, 3))
    reach = 0.9 * ratio ** random.uniform(-1.0, 0.0, 500)
    period = (8.0, 0.0, 9.0)
    finder = Finder(position, reach, skin=0.3, period=period, origin=(-1.0, 0.0, 2.0))
    expected = brute_force(position, reach + 0.3, period)
    assert len(expected) > 100 and len(expected) > 1.5 * len(brute_force(position, reach, period))
    assert finder.partners.write()
    assert finder.once(finder.partners) == expected
    assert finder.twice(finder.partners) == sorted(expected + [(j, i) for i, j in expected])


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("period", "plain"),
    [
        ((0.0, 0.0, 0.0), True),
        ((9.0, 8.0, 0.0), True),
        ((9.0, 9.0, 6.1), True),
        ((9.0, 9.0, 3.9), False),
        ((9.0, 7.0), True),
        ((0.0, 9.0), True),
    ],
    ids=["open", "open above", "three cells", "one cell", "plane", "strip"],
)
def test_partners_on_every_edge_of_a_grid_of_one_level_are_written_down(period, plain):
    """Spheres fill the box and lie on its faces; in a box one cell high partners come by the way that suits all grids."""
    backends.start("cpu", "f64", threads=2)
    random = np.random.default_rng(11)
    count = 200 if len(period) == 3 else 60
    position = random.uniform(0.0, np.where(np.array(period) > 0.0, period, 8.0), (count, len(period)))
    position[:30] = np.where(random.random((30, len(period))) < 0.5, 0.0, position[:30])
    reach = random.uniform(0.6, 0.9, count)
    finder = Finder(position, reach, skin=0.1, period=(*period, 0.0)[:3])
    expected = brute_force(position, reach + 0.1, period)
    assert finder.partners.write() and is_plain(finder.partners.grid) == plain
    assert finder.once(finder.partners) == expected
    assert finder.twice(finder.partners) == sorted(expected + [(j, i) for i, j in expected])


@pytest.mark.sampled(3)
def test_where_there_is_no_room_for_the_partners_that_is_told():
    backends.start("cpu", "f64", threads=2)
    enough = Finder(np.zeros((PARTNERS_PER_SPHERE, 3)), np.ones(PARTNERS_PER_SPHERE))
    assert enough.partners.write()
    assert not Finder(np.zeros((700, 3)), np.ones(700)).partners.write()


def test_a_place_that_is_no_number_has_no_partners_and_leaves_the_others_theirs():
    backends.start("cpu", "f64", threads=2)
    random = np.random.default_rng(8)
    position, period = random.uniform(0.0, 9.0, (300, 3)), (9.0, 9.0, 9.0)
    expected = brute_force(position[:298], np.full(298, 0.6), period)
    position[298], position[299] = np.nan, np.inf
    finder = Finder(position, np.full(300, 0.6), period=period)
    assert finder.once() == expected and len(expected) > 100


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "position",
    [np.zeros((5, 3)), np.array([[1.0, 2.0, 3.0]]), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.5, 0.0, 0.0]])],
    ids=["one place", "one sphere", "one line"],
)
@pytest.mark.parametrize("reach", [0.0, 0.5])
def test_degenerate_scenes(position, reach):
    backends.start("cpu", "f64", threads=2)
    reaches = np.full(len(position), reach)
    assert Finder(position, reaches).once() == brute_force(position, reaches)


def test_the_order_is_that_of_cell_and_index_whatever_the_threads():
    random = np.random.default_rng(7)
    position, reach = uniform(random, 5000, 3, 100.0)
    reach *= 0.3
    hashes = set()
    for threads in (1, 2, 4):
        backends.start("cpu", "f64", threads=threads)
        finder = Finder(position, reach)
        grid, partners = finder.grid, finder.partners
        order, key = grid.order.to_numpy(), grid.key.to_numpy()
        assert (np.lexsort((np.arange(5000), key)) == order).all()
        assert partners.write()
        table = grid.start.to_numpy()[: key.max() + 1], partners.begin.to_numpy(), partners.partner.to_numpy()
        hashes.add(hashlib.sha256(b"".join([order.tobytes(), *(part.tobytes() for part in table)])).hexdigest())
        backends.stop()
    assert len(hashes) == 1


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.sampled(3)
def test_nan_positions_and_point_particles_do_not_stop_the_grid(precision):
    """What is no number is found out after the step, with its particle; until then the grid has to bear it."""
    random = np.random.default_rng(3)
    backends.start("cpu", precision, threads=2)
    places, sizes = random.random((300, 3)), np.full(300, 0.05)
    for lost in (np.inf, -np.inf, np.nan, 1e38):
        for kind in ("place", "reach", "both"):
            position, reach = places.copy(), sizes.copy()
            if kind != "reach":
                position[7, 1] = lost
            if kind != "place":
                reach[9] = abs(lost)
            found = Finder(position, reach, period=(1.0, 0.0, 0.0) if kind == "place" else (0.0, 0.0, 0.0)).grid
            assert sorted(found.order.to_numpy().tolist()) == list(range(300))
    tiny = 1e-30 if precision == "f32" else 1e-200
    points = np.concatenate([places[:200], places[:50]]).astype(np.float32).astype(float)
    for scale in (1.0, tiny):
        finder = Finder(scale * points, np.zeros(250))
        assert finder.once() == [(k, 200 + k) for k in range(50)]
        buckets = np.unique(finder.grid.key.to_numpy())
        assert len(buckets) > 100, "points at different places share no cells, however small the box is"
    backends.stop()


@pytest.mark.parametrize("period", [None, (1.0, 1.0, 3.0)], ids=["open", "periodic"])
@pytest.mark.sampled(3)
def test_a_grid_built_again_knows_that_spheres_grew_or_left_the_box(period):
    """Its table stays while box and reaches do: the table of spheres that have grown would miss pairs."""
    random = np.random.default_rng(11)
    places, sizes = random.random((800, 3)), 0.03 * random.uniform(0.6, 1.0, 800)
    backends.start("cpu", "f64", threads=2)
    finder = Finder(places, sizes, **({"period": period} if period else {}))
    stay = [finder.grid.levels.table]
    for position, reach in ((places, sizes), (places * [1, 1, 3], sizes), (places, sizes), (places, 1.5 * sizes)):
        finder.position.from_numpy(position)
        finder.reach.from_numpy(reach)
        finder.grid.build(finder.position, finder.reach)
        stay.append(finder.grid.levels.table is stay[0])
        assert finder.once() == brute_force(position, reach, period)
    assert stay[1:] == [True, False, False, False]
    backends.stop()


@pytest.mark.parametrize("factors", [[1.0], [1.0, 3.0, 30.0]], ids=["one level", "levels"])
@pytest.mark.sampled(3)
def test_threads_of_a_device_build_the_same_grid(factors):
    """Slot by slot, to the last bit, whatever order spheres come into their cells in; no reach is at the edge of a bin."""
    random = np.random.default_rng(7)
    places, reaches = random.random((3000, 2)), 0.005 * random.choice(factors, 3000)
    found = []
    backends.start("cpu", "f64", threads=2)
    for kind in (CellGrid, DeviceGrid):
        position, reach = ti.Vector.field(2, float, shape=3000), ti.field(float, shape=3000)
        position.from_numpy(places)
        reach.from_numpy(reaches)
        grid = kind(3000, 2, (1.0, 0.0, 0.0))
        grid.build(position, reach, skin=1e-3)
        assert int(grid.levels.count[0]) == len(grid.levels.table) and (len(grid.levels.table) > 1) == (len(factors) > 1)
        kept = (grid.order, grid.sorted_position, grid.sorted_reach)
        found.append([field.to_numpy().tobytes() for field in kept])
    assert found[0] == found[1]
