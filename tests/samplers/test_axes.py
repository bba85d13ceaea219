import pytest
from hypothesis import given
from hypothesis import strategies as st

from scengen import config
from scengen.errors import BadConfig, ScengenError, UnknownName
from scengen.samplers.support import Interval, distance
from scengen.samplers.task import load

TASKS = config.tasks()
NODE = config.task("domino_single").node


def with_axis(**replace):
    return load("domino_single", {**NODE, "axes": {"mine": {"replace": replace}}})


@pytest.mark.parametrize("name", TASKS)
def test_every_task_has_axes_that_are_outside_and_say_why(name):
    task = config.task(name)
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
