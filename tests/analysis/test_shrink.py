"""Shrinking finds the parameters that matter, and only those."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scengen import cli, load_task
from scengen.errors import BadConfig
from scengen.ood.analysis.shrink import centre, shrink

NAMES = [f"p{i}" for i in range(12)]
MIDDLE = dict.fromkeys(NAMES, 0.0)
BEGIN = dict.fromkeys(NAMES, 1.0)
SCALES = dict.fromkeys(NAMES, 1.0)


@given(st.sets(st.sampled_from(NAMES), min_size=1, max_size=4))
def test_the_parameters_that_must_come_together_are_found_exactly(guilty):
    found = shrink(BEGIN, MIDDLE, SCALES, lambda v: all(v[n] > 0.6 for n in guilty))
    assert {c.parameter for c in found.causes} == guilty
    assert all(0.6 < c.value <= 0.6 + 1 / 32 for c in found.causes)
    assert all(found.values[n] == 0.0 for n in set(NAMES) - guilty)


@given(st.sets(st.sampled_from(NAMES), min_size=2, max_size=5))
def test_of_several_sufficient_causes_one_is_left(guilty):
    found = shrink(BEGIN, MIDDLE, SCALES, lambda v: any(v[n] > 0.3 for n in guilty))
    assert len(found.causes) == 1 and found.causes[0].parameter in guilty


@given(st.integers(0, 2**32 - 1))
def test_whatever_the_predicate_the_result_fails_and_no_scenario_is_judged_twice(seed):
    judged = []

    def fails(v):
        key = tuple(v.values())
        assert key not in judged
        judged.append(key)
        return v == BEGIN or (v != MIDDLE and hash((seed, key)) % 3 == 0)

    found = shrink(BEGIN, MIDDLE, SCALES, fails)
    assert dict(found.values) == BEGIN or hash((seed, tuple(found.values.values()))) % 3 == 0
    assert found.tries == len(judged)


def test_what_needs_a_sum_is_reported_farthest_first_in_training_widths():
    found = shrink(BEGIN, MIDDLE, {**SCALES, "p1": 0.1}, lambda v: v["p0"] + v["p1"] > 1.2)
    assert [c.parameter for c in found.causes] == ["p1", "p0"]
    assert found.causes[0].departure == pytest.approx(10 * found.causes[0].value)


def test_whole_numbers_stay_whole():
    found = shrink({"n": 9, "x": 1.0}, {"n": 2, "x": 0.0}, {"n": 1.0, "x": 1.0}, lambda v: v["n"] >= 6)
    ((cause,), tries) = found.causes, found.tries
    assert (cause.value, type(cause.value), tries <= 8) == (6, int, True)


def test_what_does_not_fail_and_what_fails_everywhere_is_refused():
    with pytest.raises(BadConfig, match="does not fail"):
        shrink(BEGIN, MIDDLE, SCALES, lambda v: False)
    with pytest.raises(BadConfig, match="the centre of training fails in the same way"):
        shrink(BEGIN, MIDDLE, SCALES, lambda v: True)


def test_the_centre_is_the_median():
    middle = centre(load_task("domino_single").training)
    assert (
        middle["gap_ratio"] == pytest.approx(0.9) and middle["x"] == pytest.approx(0.0) and middle["slab.mass"] == 0.06
    )


def test_the_command_explains_an_infeasible_scenario(tmp_path, capsys):
    told = tmp_path / "shrunk.json"
    far = "+task.axes.far={replace: {gap_ratio: [uniform, 2.1, 2.4]}}"
    assert cli.run(("axis", "shrink", "task=domino_single", far, "split=far", "index=2", f"json={told}")) == 0
    result = json.loads(told.read_text())
    assert result["check"] == "feasible" and [c["parameter"] for c in result["causes"]] == ["gap_ratio"]
    value = result["values"]["gap_ratio"]
    assert 2.0 <= value <= 2.0 + (2.4 - 0.9) / 32, "a falling tile reaches its neighbour up to gap = height"
    assert "1 of" in capsys.readouterr().out


def test_the_command_finds_two_parameters_that_only_together_make_a_scene_overlap(tmp_path):
    """A slab turned by 90 deg reaches 22 mm farther towards the last tile: too far only where the gap is smaller."""
    told = tmp_path / "shrunk.json"
    crowded = "+task.axes.crowded={replace: {gap_ratio: [uniform, 0.3, 0.4], slab_yaw: 90.0, starter: {mass: 0.1}}}"
    assert cli.run(("axis", "shrink", "task=domino_single", crowded, "split=crowded", f"json={told}")) == 0
    result = json.loads(told.read_text())
    assert result["check"] == "overlap" and {c["parameter"] for c in result["causes"]} == {"gap_ratio", "slab_yaw"}


def test_a_sampler_that_does_not_exist_is_refused(capsys):
    assert cli.run(("axis", "shrink", "task=domino_single", "sampler=nonsense")) == 2
    assert "known: iid" in capsys.readouterr().err


def test_a_scenario_that_is_fine_is_refused(capsys):
    quickly = ("certify.robust.runs=1", "certify.robust.bound=0.04")
    assert cli.run(("axis", "shrink", "task=domino_single", *quickly)) == 2
    assert "passes every check of certify=quick; give a scenario that fails one" in capsys.readouterr().err
    assert cli.run(("axis", "shrink", "task=domino_single", "index=-1")) == 2
