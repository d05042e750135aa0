"""Particles from a `.npz` or `.csv` file beside the scene."""

import csv
import io
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path as FilePath

import numpy as np

from mpp_taichi.component import Path, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.generators._base import Generator, GeneratorContext, Group, make_group
from mpp_taichi.generators._table_cells import from_word
from mpp_taichi.scene.faults import printable

# What zipfile, zlib and NumPy raise on a damaged archive.
_UNREADABLE: tuple[type[Exception], ...] = (
    *(OSError, ValueError, LookupError, EOFError, RuntimeError, TypeError, MemoryError, SyntaxError),
    *(zipfile.BadZipFile, zlib.error, struct.error),
    *(tokenize.TokenError, SyntaxError, MemoryError, ArithmeticError),  # of the text in which NumPy describes an array
)
BYTES_ALLOWED = 1 << 31  # of one array
_VECTORS = ("position", "velocity", "color", "free")
_SCALARS = ("mass", "radius", "charge")
_MERGED = "merged_into"  # of a snapshot: negative for a sphere that has not merged into another one
_CSV_COLUMNS = [*_SCALARS, *(f"{vector}_{axis}" for vector in ("position", "velocity", "free") for axis in "xyz")]
_CSV_COLUMNS += ["color_r", "color_g", "color_b", "name"]
_SUFFIXES = {"x": 0, "y": 1, "z": 2, "r": 0, "g": 1, "b": 2}


@component
class File(Generator):
    """Particles read from a file whose columns are named like the arrays of a snapshot.

    `.npz`: arrays position (n, 3), mass (n,) and, if wanted, velocity, radius, charge, color, free, name; never pickles.
    Of a state in which spheres have merged, only the remaining spheres are read.
    `.csv`: a header line, then numbers; vectors are three columns, position_x, position_y, position_z and so on.
    """

    path: Path = param(help="a file in the scene's folder or below it")

    def particle_count(self) -> int:
        """Read from the headers of the `.npz`, or by counting the lines of the `.csv`."""
        if FilePath(self.path).suffix == ".npz":
            headers = self._headers()
            shape = headers.get("mass", ((),))[0]
            if shape and headers.get(_MERGED, ((), None))[0] == shape[:1]:
                return int(np.count_nonzero(self._read_npz()[_MERGED] < 0))
            return int(shape[0]) if shape else 0
        return max(sum(1 for line in self._text().splitlines() if line.strip()) - 1, 0)

    def generate(self, context: GeneratorContext) -> Group:
        """Read the arrays, and check their shapes and numbers."""
        arrays = self._read_npz() if FilePath(self.path).suffix == ".npz" else self._read_csv()
        for key in ("position", "mass"):
            if key not in arrays:
                raise PlacementError(f"{self._short}: has no {key}, found: {', '.join(sorted(arrays)) or 'nothing'}")
        count = len(arrays["mass"]) if arrays["mass"].ndim else 0
        if count == 0:
            raise PlacementError(f"{self._short}: holds no particles")
        for key in [*_VECTORS, *_SCALARS]:
            if key in arrays:
                arrays[key] = self._checked(key, arrays[key], (count, 3) if key in _VECTORS else (count,))
        names = arrays.pop("name", np.array([""] * count))
        if names.shape != (count,) or names.dtype.kind != "U":
            raise PlacementError(f"{self._short}: name must be {count} texts")
        if _MERGED in arrays:
            left = self._checked(_MERGED, arrays.pop(_MERGED), (count,)) < 0
            arrays, names, count = {key: array[left] for key, array in arrays.items()}, names[left], int(left.sum())
        known = {key: arrays[key] for key in [*_VECTORS, *_SCALARS] if key in arrays and key != "position"}
        return make_group(count, position=arrays["position"], name=tuple(str(name) for name in names), **known)

    @property
    def _short(self) -> str:
        return FilePath(self.path).name

    def _checked(self, key: str, array: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        if array.shape != shape:
            raise PlacementError(f"{self._short}: {key} has the shape {array.shape}, must be {shape}")
        if array.dtype.kind not in "iufb":
            raise PlacementError(f"{self._short}: {key} must hold numbers")
        if not np.all(np.isfinite(array)):
            row = int(np.argwhere(~np.isfinite(array))[0][0])
            raise PlacementError(f"{self._short}: {key} of particle {row} is not a finite number")
        if key in ("mass", "radius") and np.any(array < 0):
            row = int(np.argmax(array < 0))
            raise PlacementError(f"{self._short}: {key} of particle {row} is {array[row]:g}, must be at least 0")
        if key == "color" and not np.all((array >= 0) & (array <= 1)):
            raise PlacementError(f"{self._short}: color must lie in 0…1")
        return array.astype(bool) if key == "free" else array.astype(float)

    def _headers(self) -> dict[str, tuple[tuple[int, ...], np.dtype]]:
        """Shape and type of each array, without reading the arrays: a small file can unpack to a huge one."""
        found = {}
        try:
            with zipfile.ZipFile(self.path) as archive:
                for entry in archive.namelist():
                    with archive.open(entry) as stream:
                        version = np.lib.format.read_magic(stream)
                        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                        shape, _, kind = read(stream)
                        found[entry.removesuffix(".npy")] = (shape, kind)
        except _UNREADABLE as error:
            raise PlacementError(f"{self._short}: is not an .npz file: {_reason(error)}") from None
        return found

    def _read_npz(self) -> dict[str, np.ndarray]:
        wanted = {}
        for key, (shape, kind) in self._headers().items():
            if key not in (*_VECTORS, *_SCALARS, "name", _MERGED):
                continue
            if kind.hasobject:
                raise PlacementError(f"{self._short}: {key} holds Python objects, which are never read")
            if int(np.prod(shape, dtype=object)) * kind.itemsize > BYTES_ALLOWED:
                raise PlacementError(f"{self._short}: {key} takes more than {BYTES_ALLOWED} bytes")
            wanted[key] = kind
        try:
            with np.load(self.path, allow_pickle=False) as data:
                return {key: data[key] for key in wanted}
        except _UNREADABLE as error:
            raise PlacementError(f"{self._short}: cannot be read: {_reason(error)}") from None

    def _text(self) -> str:
        path = FilePath(self.path)
        if path.suffix != ".csv":
            raise PlacementError(f"{self._short}: must be a .npz or .csv file")
        try:
            if path.stat().st_size > BYTES_ALLOWED:
                raise PlacementError(f"{self._short}: is larger than {BYTES_ALLOWED} bytes")
            return path.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            raise PlacementError(f"{self._short}: cannot be read as UTF-8 text: {error}") from None

    def _read_csv(self) -> dict[str, np.ndarray]:
        try:
            rows = [row for row in csv.reader(io.StringIO(self._text()), strict=True) if row]
        except csv.Error as error:
            raise PlacementError(f"{self._short}: is not a table: {error}") from None
        if not rows:
            raise PlacementError(f"{self._short}: is empty")
        header, body = [word.strip() for word in rows[0]], rows[1:]
        if unknown := [word for word in header if word not in _CSV_COLUMNS]:
            raise PlacementError(f"{self._short}: unknown column {unknown[0][:40]!r}, allowed: {', '.join(_CSV_COLUMNS)}")
        if len(set(header)) < len(header):
            raise PlacementError(f"{self._short}: a column is there twice")
        for number, row in enumerate(body, start=2):
            if len(row) != len(header):
                raise PlacementError(f"{self._short}: row {number} has {len(row)} entries, the header {len(header)}")
        columns = {word: [row[index] for row in body] for index, word in enumerate(header)}
        arrays: dict[str, np.ndarray] = {}
        if "name" in columns:
            arrays["name"] = np.array([from_word(cell) for cell in columns.pop("name")], dtype=str)
        for word, texts in columns.items():
            self._place_column(arrays, word, self._numbers(word, texts))
        return arrays

    def _numbers(self, word: str, texts: list[str]) -> np.ndarray:
        try:
            return np.array([float(text) for text in texts])
        except ValueError as error:
            raise PlacementError(f"{self._short}: column {word}: {error}") from None

    def _place_column(self, arrays: dict[str, np.ndarray], word: str, numbers: np.ndarray) -> None:
        vector, _, axis = word.rpartition("_")
        if not vector:
            arrays[word] = numbers
            return
        filler = 1.0 if vector == "free" else 0.0
        arrays.setdefault(vector, np.full((len(numbers), 3), filler))[:, _SUFFIXES[axis]] = numbers


def _reason(error: BaseException) -> str:
    return printable((str(error).splitlines() or [type(error).__name__])[0])
