"""The state of a process and the processor time that it has taken, from the file `stat` that Linux has for each process."""

from pathlib import Path


def stat_words(process: int) -> list[str]:
    """The words of the process's `stat` after its name, the state first; none where there is no such process or file."""
    try:
        text = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    return text.rpartition(")")[2].split()
