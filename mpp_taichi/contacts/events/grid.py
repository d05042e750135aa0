"""The grid of an event-driven run, chosen on the host."""

from dataclasses import dataclass

import numpy as np

from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.wording.told_apart import told_apart

# Excess of the edge of a cell over the largest diameter: more than round-off, so that touching spheres are in touching cells.
MARGIN = 1e-3
# Share of the room between two walls from which on spheres fill it.
FILLED = 0.5
# Number of diameters that are tried as the largest diameter of a sphere in a cell.
CUTS = 32
# Largest number of cells for each sphere.
CELLS = 2


@dataclass(frozen=True)
class Grid:
    """A grid on a torus: cell c of an axis with m cells holds the positions between c and c + 1 edges, modulo m edges.

    A torus has no end, so that spheres may fly to any distance; along a periodic axis it is the box. The few spheres that are
    too large for the cells are listed in `big`.
    """

    low: tuple[float, ...]
    edge: tuple[float, ...]
    cells: tuple[int, ...]
    period: tuple[float, ...]
    big: np.ndarray

    @classmethod
    def around(cls, setup: ContactSetup, position: np.ndarray) -> "Grid":
        """Cells that two touching spheres never lie two apart in, about as many as spheres.

        Raises ValueError for a periodic box smaller than a sphere.
        """
        d = setup.dimensions
        period = np.array(setup.enclosure.period[:d], dtype=float)
        diameter = 2 * np.asarray(setup.radius, dtype=float)
        for k, p in enumerate(period):
            if 0 < p < diameter.max():
                axis = "xyz"[k]
                edge, largest = told_apart(p, diameter.max())
                raise ValueError(f"periodic box: its edge {edge} along {axis} is less than a sphere's diameter, {largest}")
        room, origin = _room(setup, position), np.array(setup.enclosure.origin[:d])
        low, extent = np.where(period > 0, origin, room[0]), np.where(period > 0, period, room[1] - room[0])
        cut = _largest_in_cells(diameter, extent, period)
        # A dilute gas has fewer contacts than crossings.
        edge = max(cut * (1 + MARGIN), _edge_for_count(extent, CELLS * setup.particle_count)) or 1.0
        cells = np.maximum(np.floor(extent / edge), 1).astype(int)
        edges = np.where(period > 0, extent / cells, np.maximum(extent / cells, edge))
        big = np.flatnonzero(diameter > cut)
        return cls(tuple(low.tolist()), tuple(edges.tolist()), tuple(cells.tolist()), tuple(period.tolist()), big)

    def cell_of(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cells of positions (n, dimensions), and the number of turns around the torus to these positions."""
        steps = np.floor((position - np.array(self.low)) / np.array(self.edge)).astype(np.int64)
        turns = np.floor_divide(steps, np.array(self.cells))
        return (steps - turns * np.array(self.cells)).astype(np.int32), turns.astype(np.int32)

    def order_of(self, cell: np.ndarray) -> np.ndarray:
        """An order of cells (n, dimensions) in which neighbours in space are near, big spheres last: bits of the axes in turn.

        Source: Morton, A computer oriented geodetic data base, IBM (1966).
        """
        key = np.zeros(len(cell), np.int64)
        for bit in range(20):
            for k in range(cell.shape[1]):
                key |= ((cell[:, k].astype(np.int64) >> bit) & 1) << (bit * cell.shape[1] + k)
        key[self.big] = np.iinfo(np.int64).max
        return np.argsort(key, kind="stable")


def _room(setup: ContactSetup, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lowest and highest coordinates: of the walls along an axis that the spheres fill, so that gases share a grid."""
    low, high = position.min(axis=0), position.max(axis=0)
    at_rest = [each for each in setup.enclosure.surfaces if not each.moves]
    corners = np.array([place for each in at_rest if each.kind == "segment" for place in (each.point, each.end)])
    for k in range(setup.dimensions):
        planes = [each for each in at_rest if each.kind == "plane"]
        ends = [[each.point[k] for each in planes if each.direction[k] == side] for side in (1.0, -1.0)]
        if len(corners) and k < 2 and not any(ends):
            ends = [[corners[:, k].min()], [corners[:, k].max()]]
        if all(ends):
            begin, end = max(ends[0]), min(ends[1])
            if begin <= low[k] and high[k] <= end and high[k] - low[k] >= FILLED * (end - begin):
                low[k], high[k] = begin, end
    return low, high


def _largest_in_cells(diameter: np.ndarray, extent: np.ndarray, period: np.ndarray) -> float:
    """The largest diameter of spheres in cells, for which the fewest spheres are tested, in cells and big spheres."""
    sizes = np.unique(diameter)
    best, fewest = sizes[-1], np.inf
    for cut in np.unique(sizes[np.linspace(0, len(sizes) - 1, CUTS).astype(int)]):
        big = int((diameter > cut).sum())
        filled = np.prod(
            np.minimum(1.0, 3 * cut / np.where(extent > 0, extent, np.inf), where=extent > 0, out=np.ones(len(extent)))
        )
        seen = (len(diameter) - big) * filled + big
        # The nearest image of a big sphere must stay the nearest until it or its partner has left its cell.
        edge = max(cut * (1 + MARGIN), _edge_for_count(extent, CELLS * len(diameter)))
        clear = all(p == 0 or p / 2 - 4 * edge > sizes[-1] for p in period)
        if seen < fewest and (big == 0 or clear):
            best, fewest = cut, seen
    return float(best)


def _edge_for_count(extent: np.ndarray, count: float) -> float:
    """Edge of cubes of which about `count` fill a box; axes that are thinner than a cube do not count."""
    sizes = np.sort(extent[extent > 0])[::-1]
    edge = 0.0
    for used in range(1, len(sizes) + 1):
        edge = float((np.prod(sizes[:used]) / count) ** (1 / used))
        if used == len(sizes) or sizes[used] < edge:
            break
    return edge
