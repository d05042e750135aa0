"""Which cases of the sampled tests a run takes: all of them in any six runs whose numbers follow one another."""

import subprocess
import zlib

STRIDE = 97  # files between the first files of two runs
MOST = 6
"""Every case of every test runs at least in each sixth run, if no run is so slow that `--budget` cuts its sample short."""


def number(root, day):
    """The number of the commit in the history, or the number of the day where the history is not there or was cut short."""
    try:
        shallow, count = (
            subprocess.run(
                ["git", "-C", str(root), *words], capture_output=True, text=True, timeout=30, check=True
            ).stdout.strip()
            for words in (["rev-parse", "--is-shallow-repository"], ["rev-list", "--count", "HEAD"])
        )
    except (OSError, subprocess.SubprocessError):
        return day
    return int(count) if shallow == "false" else day


def turned(items, rotation):
    """The tests, file by file, beginning with another file in each run: where a run has too little time, others are last."""
    files = list(dict.fromkeys(item.nodeid.partition("::")[0] for item in items))
    begin = rotation * STRIDE % max(len(files), 1)
    place = {file: (number - begin) % len(files) for number, file in enumerate(files)}
    return sorted(items, key=lambda item: place[item.nodeid.partition("::")[0]])


def chosen(items, rotation):
    """The tests that run, and the tests that wait, of the number `rotation`.

    Of a test marked `sampled(n)` one case in n runs. The cases are taken along a diagonal, so that of two parameters that vary
    together neither stands still, and each test begins elsewhere, so that long tests spread over the runs.

    Raises:
        ValueError: a mark that would leave a case out for more than `MOST` runs.
    """
    seen, kept, left = {}, [], []
    for item in items:
        name = f"{item.parent.nodeid}::{item.originalname}"
        case = seen[name] = seen.get(name, -1) + 1
        mark = item.get_closest_marker("sampled")
        share = mark.args[0] if mark else 1
        if not 1 <= share <= MOST:
            raise ValueError(f"{item.nodeid}: sampled({share}) leaves a case out for more than {MOST} runs")
        begin = zlib.crc32(name.encode())
        (left if (case + case // share + begin + rotation) % share else kept).append(item)
    return kept, left
