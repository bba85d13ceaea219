"""The paper's mapping from pad to action, and files of events: numbers of App. C.1, dead zones, latch, clutch."""

import math

import numpy as np
import pytest

from scengen.demos.teleop.mapping import Grips, action_of, advanced, motion
from scengen.demos.teleop.pad import CONTROLS, Pad, PadEvent, line_of, read_events
from scengen.errors import ScengenError


def pad_with(**values):
    pad = Pad()
    pad.update([PadEvent(name, value) for name, value in values.items()])
    return pad


@pytest.mark.parametrize(
    ("control", "value", "channel", "expected"),
    [
        ("lefty", -1.0, 0, 0.3),
        ("leftx", -1.0, 1, 0.3),
        ("rightshoulder", 1.0, 2, 0.3),
        ("leftshoulder", 1.0, 2, -0.3),
        ("rightx", 1.0, 3, 0.2),
        ("righty", -1.0, 4, 0.2),
        ("dpleft", 1.0, 5, 0.2),
        ("dpright", 1.0, 5, -0.2),
    ],
)
def test_full_deflection_gives_the_numbers_of_the_paper(control, value, channel, expected):
    given = motion(pad_with(**{control: value}))
    assert given[channel] == pytest.approx(expected) and np.count_nonzero(given) == 1


def test_a_stick_within_its_dead_zone_is_at_rest_and_beyond_it_starts_from_nothing():
    assert not motion(pad_with(leftx=0.17, lefty=0.16)).any()
    assert np.linalg.norm(motion(pad_with(leftx=0.25))) < 0.005


def test_a_diagonal_stick_is_not_faster_than_a_straight_one():
    assert math.hypot(*motion(pad_with(leftx=1.0, lefty=1.0))[:2]) == pytest.approx(0.3)


def test_the_clutch_stops_motion_and_leaves_the_gripper():
    assert not motion(pad_with(leftx=1.0, rightshoulder=1.0, b=1.0)).any()
    assert advanced(Grips((-1.0,)), pad_with(b=1.0, a=1.0), {"a"}).commands == (1.0,)


def test_the_snap_is_latched_a_held_button_acts_once():
    pad, grips, seen = Pad(), Grips((-1.0,)), []
    for value in (1.0, 1.0, 1.0, 0.0, 1.0, 0.0):
        grips = advanced(grips, pad, pad.update([PadEvent("a", value)]))
        seen.append(grips.commands[0])
    assert seen == [1.0, 1.0, 1.0, 1.0, -1.0, -1.0]


def test_a_full_trigger_ramps_the_gripper_in_its_time_and_half_a_trigger_takes_longer():
    def periods(depth):
        grips, pad, count = Grips((-1.0,)), pad_with(righttrigger=depth), 0
        while grips.commands[0] < 1.0:
            grips, count = advanced(grips, pad, set()), count + 1
        return count

    assert periods(1.0) in (40, 41) and periods(0.5) > 80
    opened = advanced(Grips((1.0,)), pad_with(lefttrigger=1.0), set())
    assert opened.commands[0] == pytest.approx(0.95)


def test_a_button_switches_arms_and_the_other_arm_keeps_its_place_and_grip():
    pad = pad_with(lefty=-1.0)
    grips = advanced(Grips((1.0, -1.0)), pad, {"y"})
    assert grips.active == 1
    np.testing.assert_allclose(action_of(pad, grips), [0, 0, 0, 0, 0, 0, 1, 0.3, 0, 0, 0, 0, 0, -1], atol=1e-12)


# --- files of events ----------------------------------------------------------------------------


def test_a_file_gives_back_the_events_that_were_written(tmp_path):
    events = [(0, PadEvent("a", 1.0)), (0, PadEvent("leftx", -0.51234)), (731, PadEvent("a", 0.0))]
    path = tmp_path / "pad.jsonl"
    path.write_text('{"scenario": "a comment"}\n' + "\n".join(line_of(*each) for each in events) + "\n\n")
    assert read_events(path) == {0: [events[0][1], events[1][1]], 731: [events[2][1]]}


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("leftx 0.5", "line 1: not JSON"),
        ("[1]", "line 1: not an event; a line is like"),
        ('{"t": 0, "control": "lefx", "value": 0.5}', r"no control of a pad named 'lefx' \(did you mean 'leftx'"),
        ('{"t": 0, "control": "leftx"}', "value is missing"),
        ('{"t": 0, "control": "leftx", "value": 1.5}', r"leftx = 1.5; it must lie in \[-1, 1\]"),
        ('{"t": 0, "control": "lefttrigger", "value": -0.5}', r"it must lie in \[0, 1\]"),
        ('{"t": 0, "control": "a", "value": 0.5}', "a button is 0 or 1"),
        ('{"t": 0, "control": "a", "value": true}', "value = True; it must be a number"),
        ('{"t": NaN, "control": "a", "value": 1}', "not finite"),
        ('{"t": -1, "control": "a", "value": 1}', r"t = -1; it must lie in \[0, 3600\] s"),
        ('{"t": 0, "control": "a", "value": 1, "valu": 1}', "no key named 'valu'"),
        ('{"t": 1, "control": "a", "value": 1}\n{"t": 0, "control": "a", "value": 0}', "line 2: t goes back"),
    ],
)
def test_a_line_that_is_no_event_is_refused_with_its_number(tmp_path, line, says):
    path = tmp_path / "pad.jsonl"
    path.write_text(line)
    with pytest.raises(ScengenError, match=says) as raised:
        read_events(path)
    assert "\n" not in str(raised.value)


def test_a_pad_tells_only_what_is_not_at_rest():
    assert {event.control for event in pad_with(leftx=0.5, a=1.0, connected=0.0).changed()} == {
        "leftx",
        "a",
        "connected",
    }
    assert not Pad().changed() and set(CONTROLS) >= {"leftx", "righttrigger", "a", "connected"}
