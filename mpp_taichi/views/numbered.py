"""Names of files that are written at the press of a key: numbered, each with the first number that is free."""

from pathlib import Path

OUTPUT_FOLDER = Path("out")
"""The folder of output files for which the command line gives no name."""


def numbered(stem: str, *suffixes: str, folder: Path = OUTPUT_FOLDER) -> list[Path]:
    """Paths `STEM_0000` with each suffix, and with the first number for which none of them exists."""
    for number in range(10**6):
        paths = [folder / f"{stem}_{number:04d}{suffix}" for suffix in suffixes]
        if not any(path.exists() for path in paths):
            break
    return paths
