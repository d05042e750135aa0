"""The files of a report: a study as JSON, and its page."""

import json
from pathlib import Path
from typing import Any

from mpp_taichi.atomic_file import whole_text
from mpp_taichi.cli._terminal import plain


def write_report(folder: Path, name: str, found: dict[str, Any], page: str) -> list[str]:
    """Write NAME.json and NAME.html into a folder, each whole or not at all; their paths.

    Raises:
        OutputError: a file cannot be written.
    """
    texts = {f"{name}.json": json.dumps(plain(found), indent=1, allow_nan=False), f"{name}.html": page}
    for file, text in texts.items():
        whole_text(folder / file, text, "the report")
    return [str(folder / file) for file in texts]
