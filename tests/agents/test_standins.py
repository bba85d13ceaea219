"""Stand-ins over all tasks and two splits: 100 % for right answers, 0 % for wrong ones, format errors for garbage."""

from types import SimpleNamespace

import pytest
from sheets import STATED, drawn

from scengen import load_task
from scengen.agents.calls import Budget, Calls
from scengen.agents.facts import load
from scengen.agents.priors import priors
from scengen.agents.questioning import Exam, make_plan, understand
from scengen.agents.scene import View
from scengen.agents.standins import STAND_INS, Key
from scengen.work.log import Log

SCENARIOS = 5


def exams(name, split, model):
    task = load_task(name)
    fixed = {id_: prior.answer for id_, prior in priors(task, load(task), draws=20).items()} if model == "blind" else {}
    for index in range(SCENARIOS):
        sheet, scenario, found = drawn(name, split, index)
        labels = {"task": name, "split": split, "index": index, "id": scenario.id}
        row = SimpleNamespace(**labels, instruction=task.instruction, embodiment=task.embodiment, horizon=9.0)
        stand_in = STAND_INS[model](Key(found, sheet.plan, fixed))
        yield Exam(row, row.instruction, sheet, found, View({}, ("0.0 s: at rest",)), 0.0, stand_in)


def results(name, model, folder):
    for split in ("id", next(iter(load_task(name).axes))):
        with Log(folder / split / "calls.jsonl", {}) as log:
            calls = Calls(log, None, Budget())
            for exam in exams(name, split, model):
                artefact, first = understand(exam, calls)
                yield first, make_plan(exam, artefact, calls)


@pytest.mark.parametrize("name", STATED)
def test_right_answers_score_everything_and_wrong_ones_nothing(name, tmp_path):
    for first, second in results(name, "facts", tmp_path / "facts"):
        assert set(first.grades.values()) == {"right"} and second.grades["right"], second.grades
        assert first.attempts == second.attempts == 1 and second.grades["conditions"] == 1.0
    for first, second in results(name, "wrong", tmp_path / "wrong"):
        assert "right" not in first.grades.values() and not first.format_error
        assert not second.grades["right"] and not second.format_error


@pytest.mark.parametrize("name", STATED)
def test_garbage_gives_format_errors_only(name, tmp_path):
    for first, second in results(name, "garbage", tmp_path):
        assert set(first.grades.values()) == {"format"} and first.format_error and second.format_error


@pytest.mark.parametrize("name", STATED)
def test_a_blind_model_is_right_about_what_is_hidden_and_makes_no_format_error(name, tmp_path):
    for first, _ in results(name, "blind", tmp_path):
        assert not first.format_error and "forbidden" not in first.grades.values()
