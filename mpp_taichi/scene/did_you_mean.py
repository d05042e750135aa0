"""Nearest spellings for messages: "did you mean …?", and the words that are allowed."""

import difflib
from collections.abc import Iterable

MOST_LISTED = 24  # words that a message lists


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known spelling that is nearest to a word; None where none is near."""
    spellings = {each.lower(): each for each in list(known)[:10_000]}
    near = difflib.get_close_matches(word[:100].lower(), spellings, n=1, cutoff=0.5 if len(word) == 2 else 0.6)
    return spellings[near[0]] if near else None


def suggestion(word: str, known: Iterable[str]) -> str:
    """`, did you mean 'x'?` when a known spelling is near, else an empty text."""
    near = nearest(word, known)
    return f", did you mean {near!r}?" if near is not None else ""


def choices(word: str, known: Iterable[str]) -> str:
    """`, did you mean 'x'? allowed: x, y, z`; of a long list of words only the nearest are told."""
    known = list(known)
    if len(known) > MOST_LISTED:
        near = suggestion(word, known) or _some(word, known)
        return f"{near} {len(known)} names are allowed, and `mpp-taichi schema` lists them"
    return f"{suggestion(word, known) or ','} {allowed(known)}"


def _some(word: str, known: list[str]) -> str:
    """Up to three of many words of which none is near: those that have the word in them, then those that are spelt alike."""
    within = sorted((each for each in known if len(word) > 2 and word.lower() in each.lower()), key=len)
    alike = difflib.get_close_matches(word[:100].lower(), known, n=3, cutoff=0.5)
    near = [repr(each) for each in dict.fromkeys([*within, *alike])][:3]
    return f", did you mean {', '.join(near[:-1])}{' or ' if len(near) > 1 else ''}{near[-1]}?" if near else ";"


def allowed(known: Iterable[str]) -> str:
    """`allowed: a, b, c`, or a text for an empty list of words."""
    words = sorted(known)
    text = ", ".join(words[:40]) + (", …" if len(words) > 40 else "")
    return f"allowed: {text}" if words else "none is allowed here"
