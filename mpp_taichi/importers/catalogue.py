"""The importer of a file, found by the file's suffix, and among importers of one suffix by the file's beginning."""

import importlib
from pathlib import Path
from typing import Any

from mpp_taichi.errors import OutputError, SceneError
from mpp_taichi.snapshot import Snapshot

MOST_BYTES = 256 * 1024 * 1024
HEAD = 64 * 1024  # bytes, by which a list of files recognises a file


def importers() -> dict[str, Any]:
    """Every importer, by the name of its file."""
    found = sorted(path.stem for path in Path(__file__).parent.glob("[!_]*.py") if path.stem != "catalogue")
    return {name: importlib.import_module(f"mpp_taichi.importers.{name}") for name in found}


def import_scene(path: Path) -> tuple[str, dict[str, Any]]:
    """Name of the importer, and the scene as a mapping.

    Raises:
        OutputError: the file cannot be read.
        SceneError: no importer recognises the file, or a part of it cannot be read, with line and column or byte.
    """
    name, importer, content = _opened(path)
    return name, importer.read(content, str(path))


def import_particles(path: Path) -> Snapshot | None:
    """The particles, for formats that hold nothing else; raises the errors of `import_scene`."""
    _, importer, content = _opened(path)
    return importer.particles(content, str(path)) if hasattr(importer, "particles") else None


def is_recognised(path: Path) -> bool:
    """Whether some importer recognises the beginning of a file; an error further on is found by `import_scene` only."""
    known = [each for each in importers().values() if path.suffix.lower() in each.SUFFIXES]
    if not known:
        return False
    try:
        with open(path, "rb") as stream:
            head = stream.read(HEAD)
    except OSError:
        return False
    text = head.decode("utf-8-sig", errors="replace")
    return any(each.recognises(head if getattr(each, "BINARY", False) else text) for each in known)


def _opened(path: Path) -> tuple[str, Any, str | bytes]:
    """The name of the importer, the importer, and the content of the file."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise SceneError(f"{path}: is larger than {MOST_BYTES // 1024**2} MiB")
        data = path.read_bytes()
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror or error}") from None
    known = {name: each for name, each in importers().items() if path.suffix.lower() in each.SUFFIXES}
    if not known:
        suffixes = sorted({suffix for each in importers().values() for suffix in each.SUFFIXES})
        raise SceneError(f"{path}: files of this kind cannot be read, allowed: .yaml, .npz, {', '.join(suffixes)}")
    for name, importer in known.items():
        binary = getattr(importer, "BINARY", False)
        content = data if binary else _decoded(data, path, getattr(importer, "ENCODINGS", ("utf-8-sig",)))
        if len(known) == 1 or importer.recognises(content):
            return name, importer, content
    raise SceneError(f"{path}: does not begin like any of {', '.join(known)}")


def _decoded(data: bytes, path: Path, encodings: tuple[str, ...]) -> str:
    for encoding in encodings:
        try:
            return data.decode(encoding).replace("\r\n", "\n")
        except UnicodeDecodeError as error:
            fault = error
    raise SceneError(f"{path}: is no text in UTF-8: byte {fault.start} cannot be read")
