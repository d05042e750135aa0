"""Verdicts are coloured on a terminal, and only there."""

import io

import pytest

from mpp_taichi.cli import _terminal

SUMMARY = "  status  failed\n  expect  pass  a = 1, expected > 0\n  expect  FAIL  b = 1, expected < 0\n  scene   ok then"
CHECK = "FAIL  s.yaml  failed  1.0 s\n      pass  a = 1, expected > 0\n1 of 2 scenes pass"


class Terminal(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self):
        return True


@pytest.fixture
def colors(monkeypatch):
    """A terminal of many colours, whatever the tests run in."""
    for name in ("NO_COLOR", "FORCE_COLOR", "CI"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")
    return monkeypatch


def test_verdicts_are_green_and_red_on_a_terminal(colors):
    told = _terminal.painted(SUMMARY, Terminal()).split("\n")
    assert told == [
        "  status  \x1b[1;31mfailed\x1b[0m",
        "  expect  \x1b[32mpass\x1b[0m  a = 1, expected > 0",
        "  expect  \x1b[1;31mFAIL\x1b[0m  b = 1, expected < 0",
        "  scene   ok then",
    ]
    told = _terminal.painted(CHECK, Terminal())
    assert told.startswith("\x1b[1;31mFAIL\x1b[0m  s.yaml  failed  1.0 s\n      \x1b[32mpass\x1b[0m  a")
    assert told.endswith("\n1 of 2 scenes pass")


@pytest.mark.parametrize("how", ["a file", "no stream", "NO_COLOR", "a terminal without colours"])
def test_nothing_is_coloured_elsewhere(how, colors):
    if how == "NO_COLOR":
        colors.setenv("NO_COLOR", "1")
    elif how == "a terminal without colours":
        colors.setenv("TERM", "dumb")
    stream = {"a file": io.StringIO(), "no stream": None}.get(how, Terminal())
    assert _terminal.painted(SUMMARY, stream) == SUMMARY
