"""Worksheets of the course: written, filled in, and graded by runs."""

import json
from pathlib import Path

import pytest

from mpp_taichi.cli.main import main
from mpp_taichi.scene.load import load_scene
from mpp_taichi.worksheets.grading import measure
from mpp_taichi.worksheets.worksheet import load_worksheet, worksheet_names

COURSE = Path(__file__).parents[2] / "docs" / "course"
QUESTIONS = [(name, question.name) for name in worksheet_names() for question in load_worksheet(name).questions]
# What the explanations of the sheets say, computed by hand from the formulas that they give.
KNOWN = {
    "year_at_two": 365.3 * 2**1.5,
    "year_with_four_suns": 365.3 / 2,
    "year_by_long_steps": 365.30 + 4 * 0.32,
    "turn_of_three": 2 * 3.141592653589793 / (1.632993 / 2**1.5) ** 0.5,
    "turn_of_nine": 2 * 3.141592653589793 / (9.404033 / 2**1.5) ** 0.5,
    "period_without_friction": 2 * 3.141592653589793,
    "period_with_friction": 2 * 3.141592653589793 / (1 - 0.16) ** 0.5,
    "mode_one_two": 1.560,
    "four_times_stiff": 2.437 / 2,
    "light_beam": -0.334 / 4,
    "thin_light_beam": -0.01718 * 4,
    "last_ball": 4 / 3,
    "two_come_in": 1.0,
    "pressure": 1.73 * 250 / 37.5 * 0.5,
    "collision_rate": 2 * 4.96,
}


@pytest.fixture
def sheet(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "answers.yaml", "--sheet", "two_bodies"]) == 0
    capsys.readouterr()
    return tmp_path / "answers.yaml"


def answer(sheet, **given):
    lines = sheet.read_text(encoding="utf-8")
    for name, value in given.items():
        assert f"\n  {name}:\n" in lines
        lines = lines.replace(f"\n  {name}:\n", f"\n  {name}: {value}\n")
    sheet.write_text(lines, encoding="utf-8")


@pytest.mark.sampled(3)
def test_right_wrong_and_missing_answers_are_told_apart(sheet, capsys):
    answer(sheet, year_at_two=1030, year_with_four_suns=91)
    assert main(["check", str(sheet)]) == 4
    text = capsys.readouterr().out
    assert "right         year_at_two: you say 1030 days, the run says 1033." in text
    assert "not yet       year_with_four_suns: you say 91 days, the run says 182.6" in text
    assert "not answered  year_by_long_steps: write a prediction first" in text
    assert "1 of 3 right" in text
    assert "Twice the step" not in text  # the explanation of the question that is still open


def test_json_has_the_verdicts(sheet, capsys):
    answer(sheet, year_with_four_suns=182)
    assert main(["check", str(sheet), "--json", "--quiet"]) == 4
    told = json.loads(capsys.readouterr().out)
    assert [row["verdict"] for row in told["questions"]] == ["not answered", "right", "not answered"]
    assert told["right"] == 1


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("answers: {year_at_too: 3}", "answers.yaml:2:11: answers.year_at_too: unknown question, did you mean 'year_at_two'?"),
        ("answers: {year_at_two: many}", "answers.yaml:2:24: answers.year_at_two: must be a number, not 'many'"),
        ("answers: [1, 2]", "answers.yaml:2:10: answers: must be a mapping of questions to numbers, not a list of 2"),
        ("answer: {}", "answers.yaml:2:1: answer: unknown key, did you mean 'answers'?"),
    ],
)
def test_a_fault_is_told_with_its_place(written, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "answers.yaml").write_text(f"worksheet: two_bodies\n{written}\n", encoding="utf-8")
    assert main(["check", "answers.yaml"]) == 2
    assert message in capsys.readouterr().err


def test_a_wrong_name_is_answered_by_the_nearest(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "a.yaml", "--sheet", "two_body"]) == 2
    assert "did you mean 'two_bodies'?" in capsys.readouterr().err
    (tmp_path / "b.yaml").write_text("worksheet: two_body\n", encoding="utf-8")
    assert main(["check", "b.yaml"]) == 2
    assert "b.yaml:1:12: worksheet: there is no worksheet 'two_body', did you mean 'two_bodies'?" in capsys.readouterr().err
    assert main(["check", "b.yaml", "oscillator"]) == 2
    assert "is a worksheet, which is graded alone" in capsys.readouterr().err


@pytest.mark.parametrize("name", worksheet_names())
def test_every_question_is_of_a_scene_that_can_be_read(name):
    sheet = load_worksheet(name)
    assert sheet.goals and sheet.minutes and sheet.questions
    for question in sheet.questions:
        [(quantity, parameters)] = question.measure.items()
        changes = {**question.set, "expect": {quantity: {**parameters, "above": 0}}}
        assert load_scene(question.scene, overrides=changes).expect[0].quantity == quantity
        assert "\n" not in question.ask.strip() and question.because


@pytest.mark.sampled(6)
@pytest.mark.parametrize(("sheet_name", "name"), QUESTIONS)
def test_a_run_gives_what_the_explanation_says(sheet_name, name):
    [question] = [each for each in load_worksheet(sheet_name).questions if each.name == name]
    assert measure(question, backend="cpu") == pytest.approx(KNOWN[name], rel=question.within)


@pytest.mark.parametrize("name", worksheet_names())
def test_the_chapter_states_the_goals_and_names_its_worksheet(name):
    [chapter] = COURSE.glob(f"[0-9][0-9]_{name}.md")
    text, sheet = chapter.read_text(encoding="utf-8"), load_worksheet(name)
    assert all(f"\n- {goal}\n" in text for goal in sheet.goals)
    assert f"**{sheet.minutes} minutes.** Before it: {sheet.before}." in text
    assert f"--sheet {name}`" in text
    assert f"`{name}`" in (COURSE / "README.md").read_text(encoding="utf-8")


def test_every_question_has_a_known_answer():
    assert {name for _, name in QUESTIONS} == set(KNOWN)
