"""Chosen: the choice for a scene's `accuracy:`, as a line, as a file, and put into the scene."""

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from mpp_taichi.accuracy.settled import settled
from mpp_taichi.atomic_file import whole_text
from mpp_taichi.errors import OutputError
from mpp_taichi.scene.spec import SceneSpec


@dataclass(frozen=True)
class Choice:
    """The chosen method, and the reason for the choice.

    asked      the quantity that the scene names, None where it names none
    quantity   the quantity that was compared, and `quantity_because` the reason
    error      measured with exactly this step over `span` [time], the part of the run that the pilot covered
    seconds    of the steps over this span, in the pilot
    budget     processor time that the pilot might take, and `spent` what it took [s]
    """

    scene: str  # identity of its physics
    whole_span: float
    target: float
    asked: str | None
    quantity: str
    quantity_because: str
    budget: float
    spent: float
    integrator: str
    precision: str
    dt: float
    error: float
    span: float
    seconds: float
    why: str
    control: str = ""
    tolerance: float | None = None

    def line(self) -> str:
        """The choice as a line for a person."""
        setting = f"dt = {self.dt:.6g}" if self.tolerance is None else f"{self.control} = {self.tolerance:.3g}"
        method = f"{self.integrator} in {self.precision}, {setting}"
        return f"accuracy {self.target:g} of {self.quantity}: {method}; {self.why}"

    def settle(self, spec: SceneSpec) -> SceneSpec:
        """The scene with the chosen method in place of its target, in every phase with the equal steps of the pilot."""
        asked = {} if self.tolerance is None else {self.control: self.tolerance}
        return settled(spec, self.integrator, self.dt, self.whole_span, asked)


def read(path: Path) -> Choice | None:
    """The choice in a file; None where there is no file, or an older program wrote it without all that a choice tells.

    Raises:
        OutputError: the file is no choice.
    """
    if not path.is_file():
        return None
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(found, dict) and {field.name for field in fields(Choice)} - found.keys():
            return None
        return Choice(**found)
    except (OSError, ValueError, TypeError) as error:
        raise OutputError(f"{path}: not a choice of this program: {error}; remove it") from error


def write(path: Path, found: Choice) -> None:
    """Keep a choice."""
    whole_text(path, json.dumps(asdict(found), indent=1), "the choice")
