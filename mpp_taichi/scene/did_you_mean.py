"""Nearest spellings for messages: "did you mean …?", and the words that are allowed."""

import difflib
from collections.abc import Iterable


def suggestion(word: str, known: Iterable[str]) -> str:
    """`, did you mean 'x'?` when a known spelling is near, else an empty text."""
    spellings = {each.lower(): each for each in list(known)[:10_000]}
    near = difflib.get_close_matches(word[:100].lower(), spellings, n=1, cutoff=0.5 if len(word) == 2 else 0.6)
    return f", did you mean {spellings[near[0]]!r}?" if near else ""


def choices(word: str, known: Iterable[str]) -> str:
    """`, did you mean 'x'? allowed: x, y, z`."""
    known = list(known)
    return f"{suggestion(word, known) or ','} {allowed(known)}"


def allowed(known: Iterable[str]) -> str:
    """`allowed: a, b, c`, or a text for an empty list of words."""
    words = sorted(known)
    text = ", ".join(words[:40]) + (", …" if len(words) > 40 else "")
    return f"allowed: {text}" if words else "none is allowed here"
