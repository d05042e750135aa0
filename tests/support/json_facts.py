"""Values for comparisons of whole JSON objects: `found == expected` is false for a missing key, a new key and a wrong value.

A number that no independent computation gives, such as a time, stands as a range, and a text of the machine as a pattern.
"""

import json
import math
import platform
import re
from pathlib import Path

from mpp_taichi.cli.main import main


class Between:
    """Equal to every number from `low` to `high`."""

    def __init__(self, low, high=math.inf):
        self.low, self.high = low, high

    def __eq__(self, value):
        return isinstance(value, (int, float)) and not isinstance(value, bool) and self.low <= value <= self.high

    __hash__ = None

    def __repr__(self):
        return f"{self.low} … {self.high}"


class Matching:
    """Equal to every text of a pattern, as a whole."""

    def __init__(self, pattern):
        self.pattern = pattern

    def __eq__(self, value):
        return isinstance(value, str) and re.fullmatch(self.pattern, value, re.DOTALL) is not None

    __hash__ = None

    def __repr__(self):
        return f"text like {self.pattern!r}"


SECONDS = Between(0.0)


def processor():
    """The name of the processor as the system tells it, or any text where it is elsewhere."""
    told = Path("/proc/cpuinfo")
    found = re.search(r"^model name\s*: (.+)$", told.read_text(), re.MULTILINE) if told.exists() else None
    return Matching(r".+") if found is None else found[1].strip()


SYSTEM = f"{platform.system()} {platform.machine()}"


def asked(capsys, *words, code=0):
    """The JSON object that a command prints on standard output."""
    capsys.readouterr()
    ended = main([*map(str, words), "--json"])
    told = capsys.readouterr()
    assert ended == code, told.err
    return json.loads(told.out)
