"""pytest --scengen-task=...: which checks it runs, how it tells what fails, and bad input."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest
from foreign.push_block import PushBlock

from scengen.conformance import rules
from scengen.conformance.rules import Nonconformity

CONF = str(Path(__file__).parent / "foreign" / "conf")


@pytest.fixture
def checked(capsys, tmp_path, monkeypatch):
    """Runs pytest in an empty folder, and returns its exit status and what it said."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # where scengen is installed it would be loaded twice
    (tmp_path / "test_of_the_folder.py").write_text("def test_it():\n    pass\n")

    def run(*argv):
        plain = ("-p", "no:cacheprovider", "-p", "no:xdist", "-c", os.devnull, "--rootdir", str(tmp_path))
        status = pytest.main([*plain, "-p", "scengen.conformance.pytest_plugin", f"--scengen-conf={CONF}", *argv])
        both = capsys.readouterr()
        return int(status), both.out + both.err

    return run


def test_the_checks_of_a_task_run_without_a_file(checked):
    status, told = checked("--scengen-task=push_block", "-v", "-k", "not certified")
    assert status == 0 and "test_of_the_folder" not in told
    for check in (
        "id: draws are keyed",
        "far: twins differ in the axis alone",
        "judged alike for all values of y",
    ):
        assert f"scengen/push_block::{check} PASSED" in told


def test_a_broken_rule_is_told_in_one_line(checked, monkeypatch):
    monkeypatch.setattr(PushBlock, "shortcuts", lambda self: {})
    status, told = checked("--scengen-task=push_block", "-k", "id and controls")
    assert status == 1 and "push_block/id/0 has 0 shortcuts; at least 2 must show" in told
    assert "Traceback" not in told and "def _scenes" not in told


def test_nothing_is_added_where_nothing_is_asked_for(checked):
    status, told = checked("-v")
    assert status == 0 and "test_of_the_folder.py::test_it PASSED" in told and "push_block" not in told


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (("--scengen-task=push_blok",), "no task named 'push_blok' (did you mean 'push_block'?)"),
        (
            ("--scengen-task=push_block", "--scengen-axis=fat"),
            "no axis of push_block named 'fat' (did you mean 'far'?)",
        ),
        (("--scengen-task=push_block", "--scengen-axis=far", "--scengen-n=1"), "n = 1; it must be at least 2"),
        (("--scengen-axis=far",), "--scengen-axis needs --scengen-task"),
    ],
)
def test_bad_input_is_one_line_with_the_remedy(checked, argv, says):
    status, told = checked(*argv)
    assert status == pytest.ExitCode.USAGE_ERROR and says in told and "Traceback" not in told


def card(verdict="breaks replay", oracle=1.0, findings=("breaks", "too weak"), leaves=False):
    baselines = [SimpleNamespace(name=f"baseline_{i}", finding=finding) for i, finding in enumerate(findings)]
    features = [SimpleNamespace(leaves=leaves)]
    rate = None if oracle is None else SimpleNamespace(value=oracle)
    return SimpleNamespace(task="t", axis="a", verdict=verdict, oracle=rate, baselines=baselines, features=features)


def test_an_axis_that_breaks_a_memory_and_is_solvable_passes():
    rules._solvable(card())
    rules._breaks(card())
    rules._breaks(card("inconclusive", findings=("too weak", "not tried"), leaves=True))


@pytest.mark.parametrize(
    ("check", "made", "says"),
    [
        (rules._solvable, card(oracle=0.9), "the oracle solves 90% of the twins, less than 95%"),
        (rules._solvable, card(oracle=None), "solves 0%"),
        (
            rules._breaks,
            card("solved by memory", findings=("holds",)),
            "say in its why what it demands of vision",
        ),
        (rules._breaks, card("inconclusive", findings=("holds",), leaves=True), "try more twins"),
        (rules._breaks, card("inconclusive", findings=("too weak",)), "baseline_0 too weak"),
    ],
)
def test_an_axis_that_is_unsolvable_or_asks_nothing_new_fails(check, made, says):
    with pytest.raises(Nonconformity, match=says):
        check(made)
