"""A worker whose answers are kept: what an unfinished comparison has measured is not measured again."""

import numpy as np
import pytest

from mpp_taichi.archive.journal import Journal
from mpp_taichi.compare.kept_worker import KeptWorker
from mpp_taichi.compare.process import WorkerError


class Process:
    """Answers with a number that grows, and notes what it was asked."""

    def __init__(self):
        self.asked = []

    def ask(self, command, within, **fields):
        self.asked.append(command)
        if command == "peaks":
            raise WorkerError("it has died")
        if "to" in fields:
            np.savez(fields["to"], places=np.arange(3.0) + len(self.asked))
        return {"answer": len(self.asked), "facts": {"on_cpu": True}}


def asked(folder, commands):
    """The answers to commands, the arrays that came with them, and what the process was asked."""
    processes = []

    def begin():
        processes.append(Process())
        return processes[-1]

    found = []
    with Journal(folder / "journal", {}, after=0.0) as journal:
        worker = KeptWorker("cpu f64", begin, journal, lambda: None)
        for command, fields in commands:
            try:
                answer = worker.ask(command, 1.0, **fields)
                assert answer["facts"].pop("on_cpu"), "what is done with an answer does not change what is kept"
                found.append(answer["answer"])
            except WorkerError as error:
                found.append(str(error))
            if "to" in fields:
                with np.load(fields["to"]) as arrays:
                    found.append(arrays["places"].tolist())
    return found, [each for process in processes for each in process.asked]


def questions(folder, states="states.npz"):
    if not (folder / "states.npz").exists():
        np.savez(folder / "states.npz", position=np.ones(3))
    build, states = ("build", {"scene": {"a": 1}}), str(folder / states)
    gather = ("gather", {"states": states, "looks": [1, 2], "to": str(folder / "evidence.npz")})
    return [build, ("calibrate", {"seconds": 2.5}), gather, ("time", {}), ("time", {})]


def test_answers_are_taken_from_an_unfinished_comparison_and_the_rest_is_asked(tmp_path):
    first, told = asked(tmp_path, questions(tmp_path)[:4])
    assert told == ["build", "calibrate", "gather", "time"]
    (tmp_path / "evidence.npz").unlink()
    again, told = asked(tmp_path, questions(tmp_path)[:4])
    assert again == first
    assert told == [], "no process is started for what is known"
    longer, told = asked(tmp_path, questions(tmp_path))
    assert longer[: len(first)] == first
    assert told == ["build", "calibrate", "time"], "a new process is told what a later request needs"


@pytest.mark.parametrize("change", ["looks", "states", "scene"])
def test_another_request_is_asked_anew(tmp_path, change):
    asked(tmp_path, questions(tmp_path)[:3])
    given = questions(tmp_path)[:3]
    if change == "states":
        np.savez(tmp_path / "states.npz", position=np.zeros(3))
    elif change == "looks":
        given[2][1]["looks"] = [1, 2, 3]
    else:
        given[0][1]["scene"] = {"a": 2}
    _, told = asked(tmp_path, given)
    assert told[-1] == "gather"


def test_a_limit_of_time_makes_no_other_request_and_a_failure_is_tried_again(tmp_path):
    commands = [*questions(tmp_path)[:1], ("peaks", {})]
    first, _ = asked(tmp_path, [*commands[:1], ("calibrate", {"seconds": 2.5})])
    again, told = asked(tmp_path, [*commands[:1], ("calibrate", {"seconds": 0.1})])
    assert again == first and told == []
    for _ in range(2):
        found, told = asked(tmp_path, commands)
        assert found[-1] == "it has died" and told == ["build", "peaks"]
