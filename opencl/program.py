"""Compiles kernels: their texts put together, with what is known of a scene as definitions."""

from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).parent / "kernels"
# Products and sums may be fused. Square roots and divisions keep the accuracy that OpenCL promises: in f64, correct rounding.
OPTIONS = ("-cl-mad-enable", "-cl-no-signed-zeros")
REALS: dict[str, Any] = {"f32": np.float32, "f64": np.float64}


def read(name: str) -> str:
    """The text of a kernel file. The only place where they are read."""
    return (FOLDER / f"{name}.cl").read_text(encoding="utf-8")


def definition(number: float, precision: str) -> str:
    """A number as kernels are told it, to its last digit."""
    digits = float(REALS[precision](number)).hex()
    return f"({digits}{'f' if precision == 'f32' else ''})"


def build(context: Any, names: tuple[str, ...], precision: str, definitions: dict[str, Any], head: str = "") -> Any:
    """The program of these kernel files behind a text; a definition of None is one without a value."""
    import pyopencl

    text = head + "\n".join(read(name) for name in ("numbers", *names))
    known: dict[str, Any] = {"REAL": "float" if precision == "f32" else "double"}
    if precision == "f64":
        known["NEEDS_FP64"] = None
    flags = [f"-D{name}" if value is None else f"-D{name}={value}" for name, value in (known | definitions).items()]
    return pyopencl.Program(context, text).build([*OPTIONS, *flags])


class Memory:
    """The command queue of one device, and buffers in one precision."""

    def __init__(self, handle: Any, precision: str) -> None:
        """Make a context and its queue."""
        import pyopencl

        self.precision, self.real = precision, REALS[precision]
        self.context = pyopencl.Context([handle])
        self.queue = pyopencl.CommandQueue(self.context)
        self._opencl = pyopencl
        self._buffers: list[Any] = []
        self.launches = 0

    def launch(self, kernel: Any, items: int, group: int, *arguments: Any) -> None:
        """Start a kernel on whole groups of work-items, at least so many."""
        kernel(self.queue, (-(-items // group) * group,), (group,), *arguments)
        self.launches += 1

    def buffer(self, values: np.ndarray) -> Any:
        """A copy on the device."""
        flags = self._opencl.mem_flags
        values = np.ascontiguousarray(values if values.size else np.zeros(1, values.dtype))
        made = self._opencl.Buffer(self.context, flags.READ_WRITE | flags.COPY_HOST_PTR, hostbuf=values)
        self._buffers.append(made)
        return made

    def reals(self, values: np.ndarray) -> Any:
        """A copy in the precision of the run."""
        return self.buffer(np.asarray(values).astype(self.real))

    def room(self, count: int, kind: Any = None) -> Any:
        """Room for so many numbers, zeros."""
        return self.buffer(np.zeros(count, kind or self.real))

    def padded(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors of three numbers as the kernels have them, with a fourth that is zero."""
        result = np.zeros((len(vectors), 4), self.real)
        result[:, :3] = vectors
        return result

    def write(self, target: Any, values: np.ndarray) -> None:
        """Overwrite a buffer."""
        self._opencl.enqueue_copy(self.queue, target, np.ascontiguousarray(values))

    def read(self, source: Any, shape: Any, kind: Any = None) -> np.ndarray:
        """A buffer as an array."""
        values = np.empty(shape, kind or self.real)
        self._opencl.enqueue_copy(self.queue, values, source)
        return values

    def free(self, buffer: Any) -> None:
        """Give one buffer back."""
        self.queue.finish()
        self._buffers.remove(buffer)
        buffer.release()

    def release(self) -> None:
        """Give all buffers back."""
        self.queue.finish()
        for buffer in self._buffers:
            buffer.release()
        self._buffers.clear()
