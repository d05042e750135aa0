"""Backends are tried in a child process: whatever it or a driver's folder holds, the result is a report."""

import os
import sys

import pytest

from mpp_taichi.device import availability


@pytest.mark.skipif(os.name == "nt", reason="a program of a shell")
def test_a_trial_that_says_what_is_no_text_has_a_reason(tmp_path, monkeypatch):
    """A driver may write in the encoding of another language, or what it finds in memory."""
    program = tmp_path / "python"
    program.write_text("#!/bin/sh\nprintf 'driver \\377\\376' >&2\nexit 3\n", encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))
    report = availability._try_in_child("vulkan")
    assert not report["available"] and "status 3: driver" in report["reason"]


def test_a_driver_that_was_removed_and_left_a_link_does_not_end_the_program(tmp_path, monkeypatch):
    (tmp_path / "lvp.json").symlink_to(tmp_path / "nothing")
    monkeypatch.setattr(availability, "DRIVER_FOLDERS", (tmp_path, tmp_path / "missing"))
    (found,) = availability._driver_stamp()
    assert found.startswith("lvp.json:")
