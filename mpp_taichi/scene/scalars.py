"""Plain YAML scalars as YAML 1.2's core schema means them, without the traps of YAML 1.1.

`1e-9`, `.5` and `1E3` are numbers; `yes`, `on` and `2020-01-01` are text, which no key for a number takes; `010` and `1:30`,
which older readers take for 8 and 90, are refused, and so is `1e-400`, which would become 0.
"""

import re

from mpp_taichi.scene.expressions import SMALLEST_NUMBER, is_lost

_INTEGER = re.compile(r"[-+]?[0-9]+")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_LEADING_ZERO = re.compile(r"[-+]?0[0-9]+")
_SEXAGESIMAL = re.compile(r"[-+]?[0-9]+(:[0-5]?[0-9])+(\.[0-9]*)?")
_LONGEST_INTEGER = 400  # digits; a float64 ends at 309
_WORDS: dict[str, None | bool | float] = {"": None, "~": None, "null": None, "Null": None, "NULL": None}
_WORDS |= {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
_WORDS |= {sign + dot: float(sign + "inf") for sign in ("", "+", "-") for dot in (".inf", ".Inf", ".INF")}
_WORDS |= {word: float("nan") for word in (".nan", ".NaN", ".NAN")}


def read_plain(text: str) -> None | bool | int | float | str:
    """The value of a plain (unquoted) scalar; ValueError with the reason where the scalar has no value."""
    if text in _WORDS:
        return _WORDS[text]
    if _LEADING_ZERO.fullmatch(text):
        raise ValueError(f"{text[:20]} begins with a zero: write {text[:20].lstrip('+-0') or '0'}, or 0o… for octal")
    if _SEXAGESIMAL.fullmatch(text):
        raise ValueError(f"{text[:20]} is not a number here: put it in quotes if it is text")
    if _INTEGER.fullmatch(text):
        if len(text) > _LONGEST_INTEGER:
            raise ValueError(f"an integer of {len(text)} digits is too long, allowed: {_LONGEST_INTEGER}")
        return int(text)
    if _BASED.fullmatch(text):
        if len(text) > _LONGEST_INTEGER:
            raise ValueError(f"an integer of {len(text)} digits is too long, allowed: {_LONGEST_INTEGER}")
        return int(text, 0)
    if _FLOAT.fullmatch(text):
        if is_lost(text):
            raise ValueError(f"{text[:20]} is too small for a number, the least is {SMALLEST_NUMBER:.3g}")
        return float(text)
    return text
