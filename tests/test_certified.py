"""The counts of splits are measured once for the same numbers, distributions and code."""

import pytest

from scengen import load_task

pytest.importorskip("robosuite", reason="no robosuite, in which the tool plays witnesses; it is an extra")
import certified


@pytest.fixture
def calls(monkeypatch):
    """Splits that were measured, in order. The file of results is a dictionary."""
    rows, calls = {}, []
    monkeypatch.setattr(certified, "certified", lambda: rows)
    monkeypatch.setattr(certified, "write", lambda task, split, found: rows.setdefault(task, {}).update({split: found}))

    def measured(task, split, *asked):
        calls.append(split)
        return {"certified": asked[0]}

    monkeypatch.setattr(certified, "measured", measured)
    return calls


def test_a_repeated_call_measures_only_what_is_missing(calls):
    splits = ["id", *load_task("packing").axes]
    certified.main("2", f"split={splits[0]}", "packing")
    certified.main("2", "packing")
    certified.main("2", "packing")
    assert calls == splits


def test_other_numbers_are_measured_again(calls):
    for arguments in (["2"], ["3"], ["3", "draws=5"], ["3", "draws=5", "replays=1"]):
        certified.main(*arguments, "split=id", "packing")
    assert calls == ["id"] * 4


def test_the_key_tells_splits_apart():
    task = load_task("packing")
    keys = {certified.identity(task, split, 2, 5, 1) for split in ("id", *task.axes)}
    assert len(keys) == 1 + len(task.axes)
