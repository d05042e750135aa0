"""A signal while Taichi is imported: Taichi would print a page about its installation, and the program tells it in one line."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from scenes import kepler

pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
ROOT = Path(__file__).parents[2]
# The signal arrives at the moment at which Taichi loads its compiled part.
IN_IMPORT = """
import builtins, os, signal, sys
from mpp_taichi.cli.entry import main
number = getattr(signal, sys.argv.pop(1))
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "taichi._lib.core.taichi_python":
            os.kill(os.getpid(), number)
sys.meta_path.insert(0, Finder())
plain = builtins.__import__
def importing(name, *words, **more):
    try:
        return plain(name, *words, **more)
    except Exception as error:
        if name == "taichi._lib.core" and not isinstance(error, ImportError):
            raise ImportError("initialization failed") from error
        raise
builtins.__import__ = importing  # a compiled part makes an ImportError of an exception within its start
sys.exit(main())
"""


@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 143)])
@pytest.mark.sampled(3)
def test_a_signal_within_the_import_of_taichi_is_told_in_one_line(name, code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(yaml.safe_dump({**kepler(dt=0.02), "run": {"duration": 1.0}}), encoding="utf-8")
    command = [sys.executable, "-c", IN_IMPORT, name, "run", "s.yaml", "--headless", "--quiet"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (code, "", f"interrupted by {name}\n")
