"""The sample of a run: every case within six runs, in equal shares, and nothing that the README promises is left out."""

import ast
import os
import re
import shutil
import subprocess
import sys
from types import SimpleNamespace

import pytest
import rotation
from doc_commands import ROOT

PROMISES = {
    "Nothing falls back in silence": ["cli/test_cli.py::test_a_missing_backend_is_code_3"],
    "The same run gives the same bits": [
        "contacts/test_pairwise.py::test_the_bits_depend_neither_on_how_pairs_are_found_nor_on_the_threads",
        "contacts/test_swept.py::test_the_bits_do_not_depend_on_the_threads_nor_on_chance",
        "neighbors/test_cell_grid.py::test_the_order_is_that_of_cell_and_index_whatever_the_threads",
        "neighbors/test_pair_sum.py::test_bits_do_not_depend_on_the_number_of_threads",
        "neighbors/test_symmetric_pairs.py::test_the_bits_do_not_depend_on_the_number_of_threads",
        "neighbors/test_tree.py::test_the_bits_do_not_depend_on_the_threads",
        "simulation/test_plans.py::test_any_number_of_threads_gives_the_same_bits",
    ],
    "A fault is one line": ["cli/test_cli.py::test_wrong_usage_is_code_2_in_one_line"],
    "Exit codes": [
        "cli/test_cli.py::test_an_internal_error_is_code_1_and_asks_for_a_report",
        "cli/test_cli.py::test_wrong_usage_is_code_2_in_one_line",
        "cli/test_cli.py::test_a_missing_backend_is_code_3",
        "cli/test_cli.py::test_lost_energy_is_code_4_unless_allowed",
        "cli/test_cli.py::test_nan_is_code_4_and_leaves_the_last_good_state",
        "cli/test_cli.py::test_an_unwritable_file_is_code_5",
        "cli/test_cli.py::test_too_many_steps_are_code_6",
    ],
    "A step that is too large is refused": [
        "stability/test_step_advisor.py::test_the_command_line_refuses_with_the_line_of_the_spring",
        "cli/test_blow_up.py::test_a_run_that_ends_in_nan_is_led_back_to_where_it_began",
    ],
    "Precision": ["device/test_foreign_starts.py::test_the_next_simulation_has_the_precision_asked_for"],
    "can be switched off": ["device/test_fast_taichi.py::test_what_is_off_is_not_installed_and_results_stay"],
}
"""The promises of the README's list by some of their words, and tests of each that every run has."""


def case(file, name, share=None):
    """What a test looks like while it is collected."""
    mark = None if share is None else SimpleNamespace(args=(share,))
    return SimpleNamespace(
        nodeid=f"{file}::{name}", parent=SimpleNamespace(nodeid=file), originalname=name, get_closest_marker=lambda _: mark
    )


def cases(count, share, name="test_it"):
    return [case("tests/test_one.py", name, share) for _ in range(count)]


def test_every_file_is_first_in_some_run_and_files_stay_together():
    items = [case(f"tests/test_{file}.py", f"test_{k}") for file in "abcde" for k in range(3)]
    first = set()
    for run in range(20):
        order = [item.nodeid for item in rotation.turned(items, run)]
        assert sorted(order) == sorted(item.nodeid for item in items)
        files = [name.partition("::")[0] for name in order]
        assert [name for k, name in enumerate(files) if k == 0 or files[k - 1] != name] == list(dict.fromkeys(files))
        first.add(files[0])
    assert len(first) == 5 and rotation.turned([], 3) == []


@pytest.mark.parametrize("share", [1, 2, 3, 6])
@pytest.mark.parametrize("count", [1, 2, 7])
@pytest.mark.parametrize("first", [0, 1, 20_049])
def test_runs_that_follow_one_another_have_every_case_once(share, count, first):
    items = cases(count, share)
    taken = [id(item) for run in range(share) for item in rotation.chosen(items, first + run)[0]]
    assert sorted(taken) == sorted(map(id, items))


def test_what_is_not_kept_is_left_out_and_unmarked_tests_always_run():
    items = [*cases(9, 3), *cases(4, None, "test_always")]
    kept, left = rotation.chosen(items, 5)
    assert [item for item in items if item in left or item in kept] == items and not set(map(id, kept)) & set(map(id, left))
    assert len(left) == 6 and all(item.originalname == "test_it" for item in left)


def test_tests_of_one_case_spread_over_the_runs():
    """By chance 100 ± 8.2 of 300 would run: five standard deviations of a binomial distribution are the bound."""
    items = [case("tests/test_one.py", f"test_{k}", 3) for k in range(300)]
    for run in range(3):
        assert abs(len(rotation.chosen(items, run)[0]) - 100) < 41


def test_a_mark_that_leaves_a_case_out_for_longer_is_refused():
    with pytest.raises(ValueError, match=r"sampled\(7\) leaves a case out"):
        rotation.chosen(cases(30, 7), 0)


def test_the_number_is_that_of_the_commit_and_without_a_history_that_of_the_day(tmp_path):
    assert rotation.number(tmp_path, 739_000) == 739_000

    def git(*words):
        given = ["-c", "user.name=n", "-c", "user.email=e", "-c", "commit.gpgsign=false"]
        subprocess.run(["git", "-C", str(tmp_path), *given, *words], check=True, capture_output=True)

    git("init", "-q")
    for count in (1, 2):
        git("commit", "-q", "--allow-empty", "-m", "one")
        assert rotation.number(tmp_path, 739_000) == count
    subprocess.run(["git", "clone", "-q", "--depth", "1", f"file://{tmp_path}", str(tmp_path / "short")], check=True)
    assert rotation.number(tmp_path / "short", 739_000) == 739_000


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
def test_the_oldest_and_the_newest_python_are_first_in_turn():
    """The script of CI, with so little time that it names the Pythons and begins none."""

    def order(number):
        given = os.environ | {"MPP_TAICHI_TEST_ROTATION": str(number)}
        done = subprocess.run(
            ["bash", str(ROOT / ".ci" / "pythons"), "-1"], env=given, capture_output=True, text=True, timeout=60, check=True
        )
        return re.findall(r"^Python ([\d.]+): ", done.stdout, re.M)

    orders = [order(number) for number in range(4)]
    assert [each[:2] for each in orders] == 2 * [["3.10", "3.13"], ["3.13", "3.10"]]
    assert all(sorted(each) == ["3.10", "3.11", "3.12", "3.13"] for each in orders)


@pytest.mark.sampled(3)
def test_where_the_time_is_over_sampled_tests_are_skipped_and_all_others_run(tmp_path):
    """Two tests in a process of their own with the same hooks, with a budget of no time and with the usual budget."""
    (tmp_path / "conftest.py").write_text((ROOT / "tests" / "conftest.py").read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "support").symlink_to(ROOT / "tests" / "support")
    text = "import pytest\n@pytest.mark.sampled(1)\ndef test_one():\n    pass\ndef test_two():\n    pass\n"
    (tmp_path / "test_both.py").write_text(text, encoding="utf-8")
    options = ["-c", str(ROOT / "pyproject.toml"), "-n", "0", "--rootdir", str(tmp_path)]
    plain = [sys.executable, "-m", "pytest", *options, str(tmp_path)]
    cases = (["--budget", "0"], "1 passed, 1 skipped"), ([], "2 passed"), (["--budget", "0", "--thorough"], "2 passed")
    for more, said in cases:
        done = subprocess.run([*plain, *more], capture_output=True, text=True, timeout=200)
        assert done.returncode == 0 and said in done.stdout, done.stdout + done.stderr
        assert ("minutes of --budget are over" in done.stdout) is ("skipped" in said)


def test_what_the_readme_promises_is_never_left_out():
    text = (ROOT / "README.md").read_text(encoding="utf-8").partition("## What you can rely on")[2].partition("\n\nFor ")[0]
    promised = re.findall(r"^- (.+?)(?=^- |\Z)", text, re.M | re.S)
    assert len(promised) == len(PROMISES)
    for words, tests in PROMISES.items():
        assert any(words in each for each in promised), words
        assert tests, f"no test of: {words}"
        for test in tests:
            file, _, name = test.partition("::")
            tree = ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))
            found = [each for each in tree.body if isinstance(each, ast.FunctionDef) and each.name == name]
            assert found, test
            marks = [ast.unparse(each) for each in found[0].decorator_list]
            assert not any("sampled" in mark for mark in marks), f"{test} is left out of some runs"
