"""Place: a backend with a precision, on which cases run their scenes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mpp_taichi.errors import MppError, StabilityError
from mpp_taichi.precision import carries_low_parts, forces_have_low_parts
from mpp_taichi.simulation.simulation import Simulation

SINGLE, TWO_SINGLES, DOUBLE = 2.0**-24, 2.0**-47, 2.0**-53


@dataclass(frozen=True)
class Place:
    """A backend with a precision."""

    backend: str
    precision: str
    threads: int | None = None

    @property
    def u(self) -> float:
        """Largest relative rounding error of a position or velocity of one step."""
        if self.precision == "f64":
            return DOUBLE
        return TWO_SINGLES if carries_low_parts(self.precision) else SINGLE

    @property
    def force_u(self) -> float:
        """Largest relative rounding error of an operation of a force."""
        if self.precision == "f64":
            return DOUBLE
        return TWO_SINGLES if forces_have_low_parts(self.precision) else SINGLE

    def simulation(self, scene: Mapping[str, Any], **more: Any) -> Simulation:
        """The scene, compiled here; a context manager.

        Raises:
            MppError: the program refuses the scene here.
        """
        return Simulation(scene, backend=self.backend, precision=self.precision, threads=self.threads, **more)

    def refusal(self, scene: Mapping[str, Any], steps: int = 0) -> str:
        """The words with which the scene, or a run of so many steps, is refused; empty where it runs."""
        try:
            with self.simulation(scene) as simulation:
                simulation.run(steps=steps)
                sound(simulation)
        except MppError as error:
            return str(error)
        return ""


def sound(simulation: Simulation) -> None:
    """Refuse a run that the program itself calls inaccurate.

    Raises:
        StabilityError: the words of the verdict of the run.
    """
    if not simulation.verdict.is_sound:
        raise StabilityError(str(simulation.verdict))
