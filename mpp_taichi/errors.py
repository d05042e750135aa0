"""Errors the user is meant to read: one line each, with the exit code of the command line."""

INTERNAL_ERROR_CODE = 1
"""Exit code of an error that the program does not foresee."""


class MppError(Exception):
    """Base of every error this program raises on purpose."""

    exit_code = INTERNAL_ERROR_CODE


class SceneError(MppError):
    """A scene (or a `--set`) says something that cannot be run; one line per fault.

    `faults` holds the lines, each `file:line:column: key: what is wrong, what is allowed`.
    """

    exit_code = 2

    def __init__(self, *faults: str, excerpts: tuple[str, ...] = ()) -> None:
        """Join the faults, in the order of the file, into one message; `excerpts` are for `render`."""
        self.faults = faults
        self.excerpts = excerpts
        super().__init__("\n".join(faults))

    def render(self) -> str:
        """The faults for a terminal, each followed by the source line with a caret where there is one."""
        excerpts = self.excerpts or ("",) * len(self.faults)
        return "\n".join(f"{fault}\n{excerpt}" if excerpt else fault for fault, excerpt in zip(self.faults, excerpts))


class MissingPackageError(MppError):
    """A package that the program needs is missing: the program was started with a Python outside its environment.

    The exit code means wrong usage: the command named the wrong Python, and the machine lacks no device.
    """

    exit_code = 2


class ComponentError(MppError):
    """A component of one's own is no component, or has a fault; the line names its file."""

    exit_code = 2


class ArgumentError(MppError):
    """An argument of a function has a value that is not allowed."""

    exit_code = 2


class BackendError(MppError):
    """The backend, device, precision or display asked for is not available here."""

    exit_code = 3


class UnsupportedError(BackendError):
    """Something of a scene that cannot run on the backend asked for, which itself does; on others it can."""


class PrecisionError(UnsupportedError):
    """A method or contact solver that cannot run in the precision asked for; others can."""


class StabilityError(MppError):
    """A stability or accuracy limit was broken: NaN, zero distance, a failed `expect`.

    For a number that is no longer finite, `step`, `time` and `particle` say where it was born.
    """

    exit_code = 4
    step: int | None = None
    time: float | None = None
    particle: int | None = None


class AccuracyWarning(UserWarning):
    """A warning that the results of a run are not accurate; `Simulation.verdict` has the same words and numbers."""


class StateError(MppError):
    """A saved state does not belong to the scene that is to go on from it."""

    exit_code = 2


class OutputError(MppError):
    """A file could not be read or written, or the video encoder failed."""

    exit_code = 5


class CapacityError(MppError):
    """The scene asks for more memory or work than the machine has."""

    exit_code = 6


class PlacementError(ValueError):
    """The parameters of a generator are fine one by one, but nothing can be placed so; becomes a located SceneError."""
