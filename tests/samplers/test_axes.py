from unittest import mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scengen import list_tasks, load_task
from scengen.errors import BadConfig, ScengenError, UnknownName
from scengen.params import param
from scengen.samplers import keyed
from scengen.samplers.support import Interval, distance
from scengen.samplers.task import load
from scengen.symmetry import Symmetry
from scengen.tasks.domino_single import DominoSingle

TASKS = list_tasks()
NODE = load_task("domino_single").node


def with_axis(**replace):
    return load("domino_single", {**NODE, "axes": {"mine": {"replace": replace}}})


@pytest.mark.parametrize("name", TASKS)
def test_every_task_has_axes_that_are_outside_and_say_why(name):
    task = load_task(name)
    assert len(task.axes) >= 3
    for axis in task.axes.values():
        assert axis.why and axis.source
        assert {p.parameter for p in task.proofs[axis.name]} == set(axis.replace)
        assert all(p.gap > 0 for p in task.proofs[axis.name])


def test_the_gap_is_given_in_the_unit_and_in_training_widths():
    (proof,) = with_axis(gap_ratio=["uniform", 1.5, 1.8]).proofs["mine"]
    assert proof.gap == pytest.approx(0.3) and proof.relative == pytest.approx(0.5) and proof.kind == "interval"


@pytest.mark.parametrize(
    "replace",
    [
        {"gap_ratio": ["uniform", 1.1, 1.4]},  # overlaps 0.6 to 1.2
        {"gap_ratio": ["uniform", 1.2, 1.4]},  # touches it
        {"gap_ratio": 0.9},  # lies inside
        {"gap_ratio": ["choice", 0.9, 1.4]},  # half of it lies inside
        {"count": ["integer", 6, 9]},  # shares 6
        {"heading": 90},  # is one of the two
        {"slab": {"mass": 0.06}},  # is the constant of training
        {"gap_ratio": ["uniform", 1.3, 1.4], "count": 4},  # one of two parameters stays inside
    ],
)
def test_an_axis_that_stays_in_touch_with_training_is_refused(replace):
    with pytest.raises(BadConfig, match="touches or overlaps its training range"):
        with_axis(**replace)


def test_a_turn_by_the_period_is_no_departure():
    there = {**NODE, "id": {**NODE["id"], "heading": 180.0}}
    with pytest.raises(BadConfig, match="modulo 360"):
        load("domino_single", {**there, "axes": {"mine": {"replace": {"heading": -180.0}}}})
    assert with_axis(heading=-90).proofs["mine"][0].gap == pytest.approx(90)


def test_a_slab_turned_by_half_a_turn_is_the_same_slab():
    narrow = {**NODE, "id": {**NODE["id"], "slab_yaw": ["uniform", -90.0, -80.0]}}
    with pytest.raises(BadConfig, match="modulo 180"):
        load("domino_single", {**narrow, "axes": {"mine": {"replace": {"slab_yaw": ["uniform", 85.0, 90.0]}}}})
    moved = load("domino_single", {**narrow, "axes": {"mine": {"replace": {"slab_yaw": ["uniform", 80.0, 85.0]}}}})
    assert moved.proofs["mine"][0].gap == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("axes", "error"),
    [
        ({"mine": {"replace": {"gapp": 2.0}}}, UnknownName),
        ({"mine": {"replace": {"gap_ratio": 9.0}}}, ScengenError),
        ({"mine": {"replaces": {"gap_ratio": 1.4}}}, UnknownName),
        ({"mine": {"replace": {}}}, BadConfig),
        ({"mine": {"replace": [1]}}, BadConfig),
        ({"mine": 3}, BadConfig),
        ({"id": {"replace": {"gap_ratio": 1.4}}}, BadConfig),
        ({"a+b": {"replace": {"gap_ratio": 1.4}}}, BadConfig),
    ],
)
def test_a_contradicting_axis_is_refused(axes, error):
    with pytest.raises(error):
        load("domino_single", {**NODE, "axes": axes})


spans = st.tuples(st.floats(-360, 360), st.floats(0, 90)).map(lambda s: Interval(s[0], s[0] + s[1]))


@given(spans, spans, st.integers(-3, 3))
def test_distance_on_a_circle_ignores_whole_turns_and_order(a, b, turns):
    here, there = (a,), (b,)
    moved = (b.shifted(180.0 * turns),)
    assert distance(here, there, 180.0) == pytest.approx(distance(here, moved, 180.0), abs=1e-6)
    assert distance(here, there, 180.0) == pytest.approx(distance(there, here, 180.0), abs=1e-6)
    assert distance(here, there, 180.0) <= distance(here, there) + 1e-9
    assert distance(here, there, 180.0) <= 90.0 + 1e-9


@given(st.integers(-3600, 3600), st.integers(0, 900), st.integers(0, 900), st.sampled_from([None, 90.0, 180.0, 360.0]))
def test_ranges_that_touch_as_written_touch_whatever_rounding_makes_of_them(start, length, other, period):
    """With one decimal each, as in task files; nearly a fifth of such pairs had a gap of 1e-14 on a circle."""
    a, b, c = start / 10, (start + length) / 10, (start + length + other) / 10
    assert distance((Interval(a, b),), (Interval(b, c),), period) == 0.0


def test_rounding_makes_no_gap_and_a_small_step_does():
    training = (Interval(0.0, 0.3),)
    assert distance((Interval(0.1 * 3, 0.4),), training) == 0.0
    assert distance((Interval(0.3 * (1 + 1e-12), 0.4),), training) == 0.0
    assert distance((Interval(0.3001, 0.4),), training) == pytest.approx(1e-4)


def test_axes_that_lead_back_into_training_together_are_refused(monkeypatch):
    """Each mirrors one of two parameters that a symmetry mirrors together."""
    mirror = Symmetry("mirror", reflect={"y": 0.0, "heading": 0.0})
    monkeypatch.setattr(DominoSingle, "SYMMETRIES", (mirror,))
    there = {**NODE, "id": {**NODE["id"], "y": ["uniform", 0.1, 0.2], "heading": ["uniform", 10.0, 20.0]}}
    axes = {
        "over": {"replace": {"y": ["uniform", -0.2, -0.1]}},
        "round": {"replace": {"heading": ["uniform", -20, -10]}},
    }
    task = load("domino_single", {**there, "axes": axes})
    assert task.shifts("over") and task.shifts("round")
    with pytest.raises(BadConfig, match="under the symmetries of the family"):
        task.shifts("over+round")


def test_on_a_circle_the_far_end_is_what_is_farthest():
    """Between -90 and 90 straight ahead is as far as it gets, not an end of the range."""
    there = {**NODE, "id": {**NODE["id"], "heading": ["choice", -90.0, 90.0]}}
    axes = {"mine": {"replace": {"heading": ["uniform", -60.0, 50.0]}, "severities": 2}}
    task = load("domino_single", {**there, "axes": axes})
    assert task.axis("mine@2").replace["heading"].value == pytest.approx(0.0)


@pytest.mark.parametrize("period", [0, -90.0, float("inf"), float("nan")])
def test_a_period_is_a_positive_number(period):
    with pytest.raises(ValueError, match="it must be a positive number"):
        param(0.0, "deg", -180.0, 180.0, period=period)


def test_no_number_is_1(monkeypatch):
    digest = mock.Mock(digest=lambda: b"\xff" * 8)
    monkeypatch.setattr(keyed.hashlib, "blake2b", lambda *_, **__: digest)
    assert 0.999 < keyed.unit("anything") < 1.0
