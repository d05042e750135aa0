"""The passport of a run: scene, method, versions, machine, and the verdict of the last `verify` on this machine."""

import hashlib
import json
import platform
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi import __version__
from mpp_taichi.atomic_file import whole_text
from mpp_taichi.cli._terminal import plain
from mpp_taichi.device.availability import TAICHI_VERSION, cache_folder
from mpp_taichi.errors import OutputError
from mpp_taichi.scene.spec import SceneSpec

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

NOT_VERIFIED = "not verified"
LONGEST_TITLE = 1000  # letters: the comment of a ZIP archive has room for 65,535 bytes
VERSIONS = {"mpp_taichi": __version__, "taichi": TAICHI_VERSION, "numpy": np.__version__, "python": platform.python_version()}


def passport_facts(spec: SceneSpec, simulation: "Simulation") -> dict[str, Any]:
    """What the files of a run came from; no path and no name of a person or machine is among it."""
    device = simulation.device
    return {
        "title": spec.title[:LONGEST_TITLE],
        "scene_file": Path(spec.source).name,
        "scene_sha256": scene_digest(spec),
        **VERSIONS,
        "system": f"{platform.system()} {platform.machine()}",
        "backend": device.backend,
        "device": device.name,
        "precision": device.precision,
        "plan": simulation.plan,
        "integrator": plain({spec.integrator.name: spec.integrator.parameters}),
        "verified": verified(device.backend, device.precision, device.name),
    }


def scene_digest(spec: SceneSpec) -> str:
    """SHA-256 of the resolved scene, as JSON with sorted keys."""
    return hashlib.sha256(json.dumps(plain(spec.resolved), sort_keys=True).encode()).hexdigest()


def keep_verdict(found: dict[str, Any], *, length: str) -> None:
    """Keep the counts of an examination for each place, for later passports; a folder that cannot be written keeps none."""
    path, known = _verdicts_file(), _verdicts()
    for place in found["places"]:
        rows = [row for row in found["rows"] if f"{row['backend']} {row['precision']}" == place]
        counts = {status: sum(row["status"] == status for row in rows) for status in ("solved", "refused", "failed")}
        device = found["known"]["devices"][place.split()[0]]
        known[place] = {**counts, "length": length, "date": date.today().isoformat(), "device": device, **VERSIONS}
    try:
        whole_text(path, json.dumps(known, indent=1), "the verdict")
    except OutputError:
        return


def verified(backend: str, precision: str, device: str) -> dict[str, Any] | str:
    """The counts of the last examination of a place by these versions; the words `not verified` without one."""
    kept = _verdicts().get(f"{backend} {precision}")
    if not isinstance(kept, dict) or {**VERSIONS, "device": device} != {key: kept.get(key) for key in (*VERSIONS, "device")}:
        return NOT_VERIFIED
    return {key: kept.get(key) for key in ("solved", "refused", "failed", "length", "date")}


def _verdicts_file() -> Path:
    return cache_folder() / "verified.json"


def _verdicts() -> dict[str, Any]:
    try:
        found = json.loads(_verdicts_file().read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
