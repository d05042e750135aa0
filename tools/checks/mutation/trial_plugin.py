"""A plugin of pytest for one trial: the right package, fast tests first, an end when the time is up, and what was found.

The environment variable MUTATION_TRIAL is the path of a JSON file with `root`, `package`, `seconds` and `durations` (by test).
At the end the plugin adds `failed`, `reason`, `passed`, `finished` and the new `durations`.
"""

import importlib.util
import json
import os
import time
from pathlib import Path

import pytest

PLAIN = 1.0  # seconds that a test is taken to need before it has run once


class Trial:
    """One run of the tests of a mutant."""

    def __init__(self, path):
        self.path = path
        self.order = json.loads(path.read_text(encoding="utf-8"))
        self.begin = time.monotonic()
        self.durations, self.passed, self.failed, self.reason, self.finished = {}, 0, None, "", True

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items):
        """Files stay in their order; within a file, the tests that were fast before come first."""
        files = list(dict.fromkeys(item.path for item in items))
        known = self.order["durations"]
        items.sort(key=lambda item: (files.index(item.path), known.get(item.nodeid, PLAIN)))

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item):
        """No test begins when the time is up."""
        if time.monotonic() - self.begin > self.order["seconds"]:
            self.finished = False
            item.session.shouldstop = "the time of this trial is up"

    def pytest_runtest_logreport(self, report):
        """Keep the first failure, and how long each test took."""
        self.durations[report.nodeid] = self.durations.get(report.nodeid, 0.0) + report.duration
        self.passed += report.when == "call" and report.passed
        if report.failed and self.failed is None:
            self.failed, self.reason = report.nodeid, str(report.longrepr)[-400:]

    def pytest_collectreport(self, report):
        """A test file that cannot be imported has failed, too."""
        if report.failed and self.failed is None:
            self.failed, self.reason = report.nodeid, str(report.longrepr)[-400:]

    def pytest_sessionfinish(self):
        """Write what was found."""
        found = {name: getattr(self, name) for name in ("failed", "reason", "passed", "finished", "durations")}
        self.path.write_text(json.dumps(self.order | found), encoding="utf-8")


def pytest_configure(config):
    """Begin; a package from anywhere else than the mutated tree ends the run."""
    trial = Trial(Path(os.environ["MUTATION_TRIAL"]))
    found = importlib.util.find_spec(trial.order["package"])
    if found is None or not Path(found.origin).resolve().is_relative_to(trial.order["root"]):
        raise pytest.UsageError(f"{found and found.origin} would be imported, which is not the mutated package")
    config.pluginmanager.register(trial)
