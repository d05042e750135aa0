"""Clock: the time of a run, as whole steps of one length since an origin."""

from dataclasses import dataclass

MOST_STEPS_COUNTED = 2**31 - 1  # by the kernels, which count the steps since the origin in 32 bits


@dataclass(frozen=True)
class Reading:
    """All that a clock knows at one moment."""

    origin_time: float
    origin_step: int
    steps: int  # since the origin
    dt: float

    @property
    def step_count(self) -> int:
        """Steps taken since the start of the run."""
        return self.origin_step + self.steps


class Clock:
    """Tells the time of a run and holds the length of its step, `dt`.

    The time is origin + steps × dt, so that it does not gather rounding errors. A step of another length moves the origin.
    """

    def __init__(self, dt: float) -> None:
        """The clock stands at time 0 and step 0."""
        self._dt = dt
        self.set(0.0, 0)

    @property
    def dt(self) -> float:
        """Length of a step of the run."""
        return self._dt

    @dt.setter
    def dt(self, dt: float) -> None:
        if dt != self._dt:  # the steps so far had the old length
            self.set(self.time, self.step_count)
            self._dt = dt

    @property
    def time(self) -> float:
        """Simulated time."""
        return self._origin_time + self._steps * self._dt

    @property
    def step_count(self) -> int:
        """Steps taken since the start of the run."""
        return self._origin_step + self._steps

    def set(self, time: float, step_count: int) -> None:
        """Put the origin at a time and a step count, and stand there."""
        self._origin_time, self._origin_step, self._steps = time, step_count, 0

    def move(self, steps: int, dt: float) -> None:
        """Go on by so many steps of the length `dt`."""
        if dt == self._dt:
            self._steps += steps
        else:
            self.set(self.time + steps * dt, self.step_count + steps)

    def ends_of(self, steps: int, dt: float) -> list[float]:
        """The times at which each of the last steps, of the length `dt`, has ended."""
        if dt == self._dt and steps <= self._steps:
            return [self._origin_time + each * dt for each in range(self._steps - steps + 1, self._steps + 1)]
        return [self.time - back * dt for back in range(steps - 1, -1, -1)]

    def origin_of(self, steps: int, dt: float) -> tuple[float, int]:
        """The time from which a launch of so many steps counts, and the number of steps from there to its first one."""
        if dt != self._dt or self._steps + steps > MOST_STEPS_COUNTED:
            return self.time, 0
        return self._origin_time, self._steps

    def save(self) -> Reading:
        """The present reading, for `restore`."""
        return Reading(self._origin_time, self._origin_step, self._steps, self._dt)

    def restore(self, reading: Reading) -> None:
        """Go back to a reading."""
        self._origin_time, self._origin_step = reading.origin_time, reading.origin_step
        self._steps, self._dt = reading.steps, reading.dt
