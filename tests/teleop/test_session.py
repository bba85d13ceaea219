"""A take is a function of its events: it replays bit for bit, also after undo, pauses and an unplugged pad."""

import pytest
from pads import Domino

from scengen import load_task
from scengen.control.teleop import Filter
from scengen.demos.teleop.mapping import action_of, advanced
from scengen.demos.teleop.pad import Pad, PadEvent
from scengen.demos.teleop.session import (
    ENDED,
    MISSING,
    PAUSED,
    READY,
    RESUME,
    RUNNING,
    SETTLING,
    Session,
    Stage,
)
from scengen.errors import ScengenError
from scengen.validate.rebuilt import rebuild
from scengen.validate.verify.claims import passed_filter


def stage_of(name="domino_single", horizon=None):
    task = load_task(name)
    scenario = task.nominal
    return Stage(name, scenario, rebuild(scenario), task.embodiment, horizon or task.horizon, 1.0)


def press(session, *buttons):
    session.tick([PadEvent(button, 1.0) for button in buttons])
    session.tick([PadEvent(button, 0.0) for button in buttons])


def hold(session, periods, **controls):
    session.tick([PadEvent(name, value) for name, value in controls.items()])
    for _ in range(periods - 1):
        session.tick()


def driven(session, program=None):
    """Drive to the end of the episode with a program that reads the state line."""
    program = program or Domino()
    while (events := program.read(session.line)) is not None:
        session.tick(events)
    session.finish()
    return session


def test_time_stands_until_the_first_motion():
    session = Session(stage_of())
    hold(session, 50, leftx=0.1)
    assert (session.phase, session.world.time, len(session.actions)) == (READY, 0.0, 0)
    hold(session, 3, leftx=-1.0)
    assert (session.phase, len(session.actions)) == (RUNNING, 3) and session.world.time == pytest.approx(0.03)


def test_a_driven_take_replays_bit_for_bit_and_its_log_drives_it_again():
    session = driven(Session(stage_of()))
    assert session.episode.outcome == "success" and not session.given_up
    rollout = session.replayed()
    assert rollout.solved and rollout.digest == session.world.digest
    assert rollout.actions.tobytes() == session.actions.tobytes() and passed_filter(session.actions)
    again = Session(session.stage)
    for tick in range(session.ticks):
        again.tick([event for at, event in session.log if at == tick])
    assert again.actions.tobytes() == session.actions.tobytes() and again.world.digest == session.world.digest


def test_actions_are_filtered_exactly_once():
    session = Session(stage_of())
    hold(session, 30, lefty=-1.0, rightshoulder=1.0)
    once, pad = Filter(), Pad()
    pad.update([PadEvent("lefty", -1.0), PadEvent("rightshoulder", 1.0)])
    grips = advanced(session._grips, pad, set())
    expected = [once(action_of(pad, grips)).tolist() for _ in range(30)]
    assert session.actions.tolist() == expected
    assert session.actions[-1][0] == pytest.approx(0.3, abs=1e-4) and session.actions[0][0] == pytest.approx(0.15)


def test_undo_returns_to_a_saved_state_and_what_follows_replays_bit_for_bit():
    session = Session(stage_of())
    hold(session, 120, lefty=-1.0)
    before = session.world.digest
    hold(session, 100, lefty=0.0, leftx=1.0, righttrigger=1.0)
    assert session.line.grip == 1.0
    press(session, "x")
    assert session.phase == READY or session.phase == RUNNING
    session.tick([PadEvent("leftx", 0.0), PadEvent("righttrigger", 0.0)])
    assert session.undone == 1 and len(session.actions) <= 125
    hold(session, 5)
    other = Session(stage_of())
    hold(other, 120, lefty=-1.0)
    assert other.world.digest == before
    for tick in range(len(session.actions) - 120):
        other.episode.step(session.actions[120 + tick])
    assert other.world.digest == session.world.digest


def test_a_lost_episode_can_be_taken_back_and_solved():
    session = Session(stage_of(horizon=9.0))
    hold(session, 40, lefty=-1.0)
    hold(session, 950, lefty=0.0)
    assert (session.phase, session.episode.outcome) == (ENDED, "timeout")
    for _ in range(12):
        press(session, "x")
    assert session.phase == READY and session.episode.outcome is None and not len(session.actions)
    driven(session)
    assert session.episode.outcome == "success" and session.undone == 12
    assert session.replayed().solved


def test_a_reached_goal_has_to_last_without_the_person():
    session, program = Session(stage_of()), Domino()
    while session.phase != SETTLING:
        session.tick(program.read(session.line))
    count = len(session.actions)
    hold(session, 100, lefty=-1.0)
    assert session.phase == SETTLING or session.phase == ENDED
    session.finish()
    assert len(session.actions) == count + 100
    assert not session.actions[-1][:6].any() and session.replayed().solved


def test_an_unplugged_pad_pauses_the_episode_until_start_is_pressed():
    session = Session(stage_of())
    hold(session, 20, lefty=-1.0)
    hold(session, 30, connected=0.0, lefty=0.0)
    assert (session.phase, len(session.actions)) == (PAUSED, 20) and "unplugged" in session.line.message
    hold(session, 30, connected=1.0)
    assert (session.phase, len(session.actions)) == (PAUSED, 20) and session.message == RESUME
    press(session, "start")
    assert session.phase == RUNNING and not session.message


def test_a_take_that_starts_without_a_pad_names_none_that_was_unplugged():
    session = Session(stage_of())
    hold(session, 3, connected=0.0)
    assert (session.phase, session.message) == (PAUSED, MISSING)
    hold(session, 3, connected=1.0)
    assert (session.phase, session.message) == (PAUSED, RESUME)
    press(session, "start")
    assert session.phase == RUNNING and not session.message


def test_start_pauses_and_goes_on_and_back_gives_up():
    session = Session(stage_of())
    hold(session, 10, lefty=-1.0)
    press(session, "start")
    assert session.phase == PAUSED and len(session.actions) == 10
    press(session, "start")
    assert session.phase == RUNNING
    press(session, "back")
    assert session.finished and session.given_up


def test_a_take_that_does_not_replay_is_refused():
    session = driven(Session(stage_of()))
    session._actions[100] = session._actions[100] * 0.5
    with pytest.raises(ScengenError, match="does not replay bit for bit"):
        session.replayed()


def test_the_state_line_says_time_outcome_and_where_things_are():
    line = Session(stage_of()).line
    assert line.text.startswith(" 0.00 of 12 s   ready")
    assert line.bodies["tile_0"][2] == pytest.approx(0.8) and line.boxes["tile_0"][5] > 0.05
    assert not any(name.startswith(("robot", "gripper")) for name in line.bodies)


def test_a_button_drives_the_other_arm():
    session = Session(stage_of("plate_shelf_hobi"))
    hold(session, 20, lefty=-1.0)
    press(session, "y")
    hold(session, 20)
    moved = abs(session.actions).max(axis=1)
    assert session.line.arm == 1 and session.actions.shape[1] == 14 and moved.all()
    assert session.actions[19][0] > 0.25 and session.actions[19][7] == 0.0
    assert session.actions[-1][7] > 0.25 and session.actions[-1][0] < 0.01
