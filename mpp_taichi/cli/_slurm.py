"""SLURM: the script of an array of jobs that share a sweep."""

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path


def slurm_script(words: Sequence[str], jobs: int, folder: Path) -> str:
    """The script of an array of jobs; a job that is cut off and queued again goes on."""
    kept, skip = [], False
    for word in words:
        if skip or word.startswith("--slurm="):
            skip = False
        elif word == "--slurm":
            skip = True
        else:
            kept.append(word)
    command = shlex.join([sys.executable, "-m", "mpp_taichi", *kept])
    lines = [
        "#!/bin/sh",
        *(f"#SBATCH --{option}" for option in (f"job-name={folder.stem}", f"array=1-{jobs}", "ntasks=1", "cpus-per-task=1")),
        "#SBATCH --requeue",
        f"cd {shlex.quote(str(Path.cwd()))} || exit 1",
        f'exec {command} --workers 1 --part "$SLURM_ARRAY_TASK_ID/{jobs}"',
    ]
    return "\n".join(lines)
