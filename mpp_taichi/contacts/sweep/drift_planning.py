"""Plans of a drift: into which pieces it is cut, and how far around a sphere its candidate partners are."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.round_off import round_off
from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.shared.contact_counts import CHUNKS
from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu
from mpp_taichi.device.heavy_loops import is_heavy, loop_grain
from mpp_taichi.types import Template

SLACK = 1.25  # margin over the way of a sphere at its present speed: contacts make some spheres faster
TRAVEL_PER_GAP = 0.5  # largest root mean square way in a piece, over the mean gap between spheres
TRAVEL_PER_RADIUS = 0.25  # the same over the mean radius, where the spheres nearly touch
LEAST_TRAVEL_PER_RADIUS = 0.02  # a shorter piece is not cut for its many contacts: any piece has them
CROWD = 0.3  # contacts per sphere, above which islands grow together and a piece is cut
OUTLIER = 6.0  # root mean square speeds that the margins of all spheres allow for; faster spheres have their own margins
DRIFTS_PER_SKIN = 3  # more drifts for which a grid is kept
SKIN_PER_RADIUS = 0.4  # largest skin over the mean radius
SKIN_SLACK = 1.05  # skin over the way of the fastest sphere, for spheres that become a little faster
DEVICE_CHUNKS = 4096  # of spheres on another device than the CPU, each measured by a thread
ROUNDINGS = 16  # of a coordinate, in every margin, so that rounding hides no pair


class Piece(NamedTuple):
    """A piece of a drift. Its plan is made with plain numbers, as arrays of three entries cost more than the arithmetic.

    h             length [time]
    common        least margin, which every sphere has [length]
    largest       largest margin that a sphere may have [length]
    lower, upper  bounding box of all positions [length]
    speed, rms    largest and root mean square speed [length / time]
    reference     speed that the common margin allows for [length / time]
    rounding      part of every margin, for the rounding of positions [length]
    time          time in which a sphere at its speed flies through its own margin: h and the slack [time]
    skin          distance by which the cell grid reaches farther, to be good for some drifts; 0: not worthwhile [length]
    tries         how often its margins were widened
    """

    h: float
    common: float
    largest: float
    lower: Sequence[float]
    upper: Sequence[float]
    least_radius: float
    largest_radius: float
    speed: float
    rms: float
    reference: float
    rounding: float
    time: float = 0.0
    skin: float = 0.0
    tries: int = 0

    @property
    def is_uniform(self) -> bool:
        """Whether all margins are `common`: no sphere is much faster than most, and none left its margin."""
        return self.largest <= self.common

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray, float, float]:
        """Arguments of the cell grid: the bounding box, and the least and largest reach."""
        lower, upper = np.array(self.lower), np.array(self.upper)
        return lower, upper, self.least_radius + self.common, self.largest_radius + self.largest


class MotionSummary(NamedTuple):
    """Summary of the motion of all spheres, from which a drift is planned.

    lower, upper  bounding box of all positions [length]
    total         Σ v² [length² / time²]
    speed         largest speed [length / time]
    farthest      largest margin that is remembered of spheres that left theirs [length]
    way           longest way of a sphere in the piece before; 0 if it was not measured [length]
    """

    lower: Sequence[float]
    upper: Sequence[float]
    total: float
    speed: float
    farthest: float
    way: float


@ti.data_oriented
class DriftPlanner:
    """Cuts a drift into pieces, and gives each sphere of a state its margin; reach = radius + margin.

    The margin of a sphere covers its own way with some slack, and the way of a partner of ordinary speed that may hit it. A
    sphere that left its margin is remembered with twice its way, and the piece is done again.

    reach        (n,) [length]
    remembered   (n,) margins of the spheres that left theirs, else 0 [length]
    farthest     largest of the remembered margins [length]
    violations   1: some sphere left its margin in this piece
    """

    def __init__(self, setup: ContactSetup, state: Any) -> None:
        """Allocate; needs a started Taichi."""
        self.particle_count = setup.particle_count
        self.dimensions = setup.dimensions
        self.state = state
        self.period = tuple(float(edge) for edge in setup.enclosure.period[: setup.dimensions])
        self.shortest_period = min((edge for edge in self.period if edge > 0.0), default=math.inf)
        radius = np.asarray(setup.radius, float)
        self.mean_radius, self.least_radius, self.largest_radius = (
            float(radius.mean()),
            float(radius.min()),
            float(radius.max()),
        )
        largest_two = float(np.sort(radius)[-2:].sum())
        # Room for a margin: beyond it another image of the partner may be nearer.
        self.room = 0.5 * (self.shortest_period / 2.0 - largest_two)
        if not self.room > 0.0:
            raise ValueError(
                f"a period of {self.shortest_period:g} is too short for spheres of radius {self.largest_radius:g}: "
                f"two of them must fit into half of it"
            )
        self.epsilon = 2.0 * round_off()
        self.on_cpu = on_cpu()
        self.chunks = CHUNKS if self.on_cpu else DEVICE_CHUNKS
        self.radius, self.reach, self.remembered = (ti.field(float) for _ in range(3))
        self.measured = ti.Vector.field(2 * self.dimensions + 3, float)
        self.farthest = ti.field(float)
        self.violations = ti.field(ti.i32)
        self._trees = FieldTrees()
        for field in (self.radius, self.reach, self.remembered):
            self._trees.place(self.particle_count, field)
        self._trees.place(self.chunks, self.measured)
        self._trees.place(1, self.farthest)
        self._trees.place(1, integers=[self.violations])
        self._trees.finish()
        self.radius.from_numpy(radius.astype(self.radius.to_numpy().dtype))

    def destroy(self) -> None:
        """Give the memory back."""
        self._trees.destroy()

    def plan(self, rest: float, motion: MotionSummary) -> Piece:
        """The next piece of a drift of which `rest` is left."""
        speed = motion.speed
        rms = math.sqrt(motion.total / self.particle_count)
        room = 1.0 / self.particle_count
        for low, high, period in zip(motion.lower, motion.upper, self.period, strict=True):
            room *= period if period > 0.0 else max(high - low, 2.0 * self.mean_radius)
        spacing = room ** (1.0 / self.dimensions)
        travel = max(TRAVEL_PER_GAP * (spacing - 2.0 * self.mean_radius), TRAVEL_PER_RADIUS * self.mean_radius)
        count = max(1.0, math.ceil(rms * rest / travel)) if travel > 0.0 else 1.0
        if SLACK * speed * rest / count > 0.9 * self.room:
            count = math.ceil(SLACK * speed * rest / (0.9 * self.room))
        h = rest / count
        is_ordinary = SLACK * speed * h <= 0.5 * max(spacing, self.mean_radius)
        reference = speed if is_ordinary else min(speed, OUTLIER * rms)
        rounding = ROUNDINGS * self.epsilon * max(map(abs, (*motion.lower, *motion.upper)))
        radii = self.least_radius, self.largest_radius
        piece = Piece(h, 0.0, 0.0, motion.lower, motion.upper, *radii, speed, rms, reference, rounding)
        return self._with_margins(piece, motion.farthest)

    def measure(self, position: Any, velocity: Any) -> MotionSummary:
        """Summarize the motion of spheres in any order."""
        if self.on_cpu:
            return self.motion(self._measure_at_once(position, velocity))
        d = self.dimensions
        self._measure(position, velocity)
        found = self.measured.to_numpy().astype(float)
        lower, upper, farthest = found[:, :d].min(0), found[:, d : 2 * d].max(0), float(self.farthest[0])
        return MotionSummary(lower, upper, float(found[:, 2 * d].sum()), float(found[:, 2 * d + 1].max()), farthest, 0.0)

    def motion(self, whole: Sequence[float]) -> MotionSummary:
        """The summary that the entries of `whole` make."""
        d = self.dimensions
        return MotionSummary(whole[:d], whole[3 : 3 + d], *whole[6:])

    def _with_margins(self, piece: Piece, farthest: float) -> Piece:
        common = SLACK * piece.reference * piece.h + piece.rounding
        largest = max(SLACK * piece.speed * piece.h + piece.rounding, farthest)
        return piece._replace(common=common, largest=largest, time=SLACK * piece.h, skin=self._skin(piece, largest))

    def _skin(self, piece: Piece, largest: float) -> float:
        """Room for the fastest sphere in some more drifts of this length, 0 where the spheres would get too many partners."""
        way = SKIN_SLACK * piece.speed * piece.h
        limit = min(SKIN_PER_RADIUS * self.mean_radius, 0.9 * self.room - largest)
        return way * min(DRIFTS_PER_SKIN, math.floor(limit / way)) if 0.0 < way <= limit else 0.0

    def shorten(self, piece: Piece) -> Piece:
        """The first half of a piece; all margins that were remembered are forgotten."""
        self.remembered.fill(0.0)
        self.farthest.fill(0.0)
        return self._with_margins(piece._replace(h=piece.h / 2.0, tries=0), 0.0)

    def widen(self, piece: Piece) -> Piece:
        """The piece again with the remembered margins, or its first half where wider margins did not help or have no room."""
        farthest = float(self.farthest[0])
        if piece.tries >= 6 or farthest > 0.9 * self.room:
            return self.shorten(piece)
        return self._with_margins(piece._replace(tries=piece.tries + 1), farthest)

    def is_crowded(self, piece: Piece, links: int) -> bool:
        """Whether a piece has so many contacts that its two halves cost less."""
        return links > CROWD * self.particle_count and piece.rms * piece.h > LEAST_TRAVEL_PER_RADIUS * self.mean_radius

    @ti.func
    def note_violation(self, i, way):
        """Note that sphere i has left its margin by going so far, and give it a wider one when the piece is done again."""
        self.violations[0] = 1
        self.remembered[i] = 2.0 * way
        if ti.static(self.on_cpu):
            ti.atomic_max(self.farthest[0], 2.0 * way)

    @ti.kernel
    def find_farthest(self):
        """Set `farthest`; on the CPU it is set whenever a margin is remembered."""
        for i in range(self.particle_count):
            if self.remembered[i] > self.farthest[0]:
                ti.atomic_max(self.farthest[0], self.remembered[i])

    def set_reaches(self, piece: Piece) -> None:
        """Set the reach of each sphere, by the velocities of the state."""
        self._set_reaches(piece.common, piece.time, piece.rounding)

    @ti.kernel
    def _set_reaches(self, common: float, time: float, rounding: float):
        for i in range(self.particle_count):
            self.reach[i] = self.radius[i] + self.margin(i, self.state.velocity[i], common, time, rounding)

    @ti.func
    def margin(self, i, v, common, time, rounding):
        """Margin of sphere i, which flies with v; its remembered margin is read only where some sphere has one."""
        result = ti.max(common, time * v.norm() + rounding)
        if self.farthest[0] > 0.0:
            result = ti.max(result, self.remembered[i])
        return result

    @ti.kernel
    def _measure(self, position: Template, velocity: Template):
        self._measure_all(position, velocity)

    @ti.kernel
    def _measure_at_once(self, position: Template, velocity: Template) -> ti.types.vector(10, ti.f64):
        """Measure and return the summary of all chunks, in one launch."""
        self._measure_all(position, velocity)
        return self.whole()

    @ti.func
    def _measure_all(self, position: Template, velocity: Template):
        grain = ti.static(loop_grain())
        for q in range(self.chunks * grain):
            if is_heavy(q, grain):
                chunk = q // grain
                self.measure_chunk(chunk, position, velocity, 0.0)

    @ti.func
    def measure_chunk(self, chunk, position: Template, velocity: Template, way):
        """Summarize the motion of the spheres of a chunk, whose longest way in the piece before was `way`."""
        lower = ti.Vector([ti.math.inf] * self.dimensions, float)
        upper = -lower
        total, largest = 0.0, 0.0
        for i in range(self.begin_of(chunk), self.begin_of(chunk + 1)):
            x, v = position[i], velocity[i]
            lower = ti.min(lower, x)
            upper = ti.max(upper, x)
            total += v.norm_sqr()
            largest = ti.max(largest, v.norm_sqr())
        for axis in ti.static(range(self.dimensions)):
            self.measured[chunk][axis] = lower[axis]
            self.measured[chunk][self.dimensions + axis] = upper[axis]
        self.measured[chunk][2 * self.dimensions] = total
        self.measured[chunk][2 * self.dimensions + 1] = ti.sqrt(largest)
        self.measured[chunk][2 * self.dimensions + 2] = way

    @ti.func
    def whole(self):
        """Summary of all chunks: lower and upper corner, Σ v², largest speed, margin and way; not inside a loop."""
        lower, upper = ti.Vector([ti.math.inf] * 3, ti.f64), ti.Vector([-ti.math.inf] * 3, ti.f64)
        total, speed, way = ti.cast(0.0, ti.f64), ti.cast(0.0, ti.f64), ti.cast(0.0, ti.f64)
        ti.loop_config(serialize=True)
        for chunk in range(self.chunks):
            found = ti.cast(self.measured[chunk], ti.f64)
            for axis in ti.static(range(self.dimensions)):
                lower[axis] = ti.min(lower[axis], found[axis])
                upper[axis] = ti.max(upper[axis], found[self.dimensions + axis])
            total += found[2 * self.dimensions]
            speed = ti.max(speed, found[2 * self.dimensions + 1])
            way = ti.max(way, found[2 * self.dimensions + 2])
        farthest = ti.cast(self.farthest[0], ti.f64)
        return ti.Vector([lower[0], lower[1], lower[2], upper[0], upper[1], upper[2], total, speed, farthest, way])

    @ti.func
    def begin_of(self, chunk):
        """First sphere of a chunk; 64 bits, because the product may not fit 32."""
        return ti.cast(ti.cast(chunk, ti.i64) * self.particle_count // self.chunks, ti.i32)
