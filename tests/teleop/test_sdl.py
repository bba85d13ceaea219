"""The path through SDL: a virtual pad drives, is unplugged and plugged in; keys act as a pad; the window shows."""

import importlib.util
import os

import numpy as np
import pytest
from helpers import pictures_are_possible
from pads import Domino
from test_session import stage_of

from scengen.demos.teleop.drive import Timing, drive
from scengen.demos.teleop.pad import BUTTONS, STICKS, TRIGGERS, PadEvent
from scengen.demos.teleop.session import PAUSED, Session

if importlib.util.find_spec("pygame") is None:
    pytest.skip("no pygame; it is in the extra teleop", allow_module_level=True)
else:
    import pygame
    from virtual_pad import VirtualPad, measure

    from scengen.demos.teleop.sdl import KEYS, Gamepad, Keyboard, Window

LINE = None
"""State line of a device that does not read it."""


@pytest.fixture(autouse=True)
def no_display(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


@pytest.fixture
def gamepad():
    device = Gamepad()
    device.begin()
    yield device
    device.close()


def read(device):
    return list(device.read(LINE))


def test_a_pad_tells_every_control_by_its_name(gamepad):
    pad = VirtualPad()
    assert PadEvent("connected", 1.0) in read(gamepad)
    read(gamepad)  # the triggers come to rest
    for control in set(BUTTONS) - {"guide"}:  # SDL delays the release of guide
        pad.set(control, 1)
        assert read(gamepad) == [PadEvent(control, 1.0)]
        pad.set(control, 0)
        assert read(gamepad) == [PadEvent(control, 0.0)]
    for control in STICKS:
        pad.set(control, -1.0)
        assert read(gamepad) == [PadEvent(control, -1.0)]
        pad.set(control, 0.5)
        (event,) = read(gamepad)
        assert event.control == control and event.value == pytest.approx(0.5, abs=1e-3)
    for control in TRIGGERS:
        pad.set(control, 1.0)
        (event,) = read(gamepad)
        assert event.control == control and event.value == pytest.approx(1.0, abs=1e-3)
    pad.unplug()


def test_a_pad_that_is_unplugged_pauses_the_take_and_another_one_goes_on(gamepad):
    session, pad = Session(stage_of()), VirtualPad()
    session.tick(read(gamepad))
    pad.set("lefty", -1.0)
    for _ in range(10):
        session.tick(read(gamepad))
    assert len(session.actions) == 10
    pad.unplug()
    for _ in range(5):
        session.tick(read(gamepad))
    assert session.phase == PAUSED and len(session.actions) <= 10
    other = VirtualPad()
    session.tick(read(gamepad))
    assert session.phase == PAUSED
    other.set("start", 1)
    session.tick(read(gamepad))
    other.set("lefty", -1.0)
    for _ in range(5):
        session.tick(read(gamepad))
    assert len(session.actions) >= 15 and session.actions[-1][0] > 0.2
    other.unplug()


def test_without_a_pad_the_take_waits(gamepad):
    gamepad.begin()
    session = Session(stage_of())
    session.tick(read(gamepad))
    assert session.phase == PAUSED and not len(session.actions)


def test_buttons_that_are_held_between_two_takes_do_not_act_again(gamepad):
    pad = VirtualPad()
    pad.set("start", 1)
    pad.set("leftx", 1.0)
    read(gamepad)
    gamepad.begin()
    assert [event.control for event in read(gamepad)] == ["leftx"]
    pad.set("start", 0)
    assert read(gamepad) == [PadEvent("start", 0.0)]
    pad.unplug()


def test_the_loop_drives_in_real_time_and_events_act_soon():
    timing, _, delays = measure(1.5)
    assert len(delays) > 8
    assert np.median(delays) < 0.03  # the machine of the tests is busy; virtual_pad.py measures
    assert len(timing.late) > 100 and "control periods" in timing.told()


def test_a_whole_take_is_driven_by_the_virtual_pad(gamepad):
    """The events of a program go through SDL, and act as if they had come from a file."""
    pad, program = VirtualPad(), Domino()
    direct, driven = Session(stage_of()), Session(stage_of())
    driven.tick(read(gamepad))
    direct.tick()
    while driven.episode.outcome is None:
        for event in program.read(driven.line) or ():
            pad.set(event.control, event.value)
        events = read(gamepad)
        driven.tick(events)
        direct.tick(events)
    assert driven.episode.outcome == "success" and direct.world.digest == driven.world.digest
    pad.unplug()


# --- keyboard and window ------------------------------------------------------------------------


def key(name, down):
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN if down else pygame.KEYUP, key=pygame.key.key_code(name)))


@pytest.fixture
def keyboard():
    device = Keyboard()
    pygame.display.set_mode((64, 64))
    device.begin()
    yield device
    device.close()


@pytest.mark.parametrize("name", KEYS)
def test_a_key_acts_as_its_control(keyboard, name):
    control, value = KEYS[name]
    key(name, True)
    assert read(keyboard) == [PadEvent(control, value)]
    key(name, False)
    assert read(keyboard) == [PadEvent(control, 0.0)]


def test_opposite_keys_cancel_each_other_and_a_lost_focus_releases_all(keyboard):
    key("a", True)
    read(keyboard)
    key("d", True)
    assert read(keyboard) == [PadEvent("leftx", 0.0)]
    key("a", False)
    assert read(keyboard) == [PadEvent("leftx", 1.0)]
    pygame.event.post(pygame.event.Event(pygame.WINDOWFOCUSLOST))
    assert read(keyboard) == [PadEvent("leftx", 0.0)]


@pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL")
@pytest.mark.parametrize("task", ["domino_single", "mirror_pick_place"])
def test_the_window_shows_the_scene_as_it_is_driven(keyboard, task, tmp_path):
    session = Session(stage_of(task))
    window = Window(session, 320, 240, None)
    for name in ("w", "r"):
        key(name, True)
    pictures, timing = [], Timing()

    def show(session):
        window.show(session)
        pictures.append(pygame.surfarray.array3d(pygame.display.get_surface()).copy())
        if window.drawn >= 8:
            session.finish()

    drive(session, keyboard, timing, show)
    drawn = window.drawn
    window.close()
    assert drawn >= 2 and pictures[-1].shape == (320, 280, 3)
    assert pictures[-1][:, :240].std() > 10 and (pictures[-1][:, :240] != pictures[0][:, :240]).mean() > 0.01
    if "SHOTS" in os.environ:
        pygame.image.save(pygame.surfarray.make_surface(pictures[-1]), f"{os.environ['SHOTS']}/{task}.png")
