"""A recording world behaves bit by bit like any other and records each question about contact."""

import copy

import numpy as np
import pytest

from scengen.errors import UnknownName
from scengen.sim.arm import ROBOT
from scengen.sim.recording import Question, RecordingWorld
from scengen.sim.world import World
from scengen.tasks.domino_single import DominoSingle
from scengen.validate.rebuilt import rebuild

SCENE = rebuild(DominoSingle())
PRESS = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0])


@pytest.fixture
def pressed():
    """An ordinary world whose hand presses on the table."""
    world = World.load(SCENE)
    while not world.touching(ROBOT, "table"):
        assert world.time < 10.0, "the hand reaches the table"
        world.step(PRESS)
    return world


def questions(world):
    """Questions with both answers, and their answers."""
    bodies = [name for name in world.free_bodies if world.touching_bodies(name)]
    assert bodies, "something stands on something"
    pairs = [(ROBOT, "table"), (ROBOT, bodies[0]), (world.arm.label, "table"), (bodies[0], "table")]
    asked = [(kind, pair) for kind in ("touching", "touched") for pair in pairs]
    return [(kind, names, getattr(world, kind)(*names)) for kind, names in [*asked, ("touching_bodies", ("table",))]]


def test_a_twin_answers_as_the_original_and_records_kind_names_and_answer(pressed):
    told = questions(pressed)
    assert {answer for _, _, answer in told[:-1]} == {True, False}
    twin = RecordingWorld.twin(pressed)
    assert not twin.asked
    for kind, names, answer in told:
        assert getattr(twin, kind)(*names) == answer
    assert twin.asked == [Question(kind, names, told_answer(answer)) for kind, names, answer in told]
    twin.asked.clear()
    assert questions(twin) == told and len(twin.asked) >= len(told)


def told_answer(answer):
    """An answer as a question holds it."""
    return frozenset(answer) if isinstance(answer, set) else answer


def test_a_changed_answer_changes_no_record(pressed):
    twin = RecordingWorld.twin(pressed)
    twin.touching_bodies("table").clear()
    assert ROBOT in twin.asked[-1].answer


def test_a_question_about_an_unknown_body_is_no_question(pressed):
    twin = RecordingWorld.twin(pressed)
    with pytest.raises(UnknownName):
        twin.touched(ROBOT, "nothing")
    assert not twin.asked


def test_recording_changes_no_bit_and_no_other_world(pressed):
    before = pressed.digest
    twin, loaded = RecordingWorld.twin(pressed), RecordingWorld.load(SCENE)
    assert twin.digest == before and loaded.digest == World.load(SCENE).digest
    for _ in range(30):
        for world in (pressed, twin):
            world.step(-PRESS)
            world.touching(ROBOT, "table")
    assert twin.digest == pressed.digest != before and np.array_equal(twin.state(), pressed.state())
    assert len(twin.asked) == 30 and not copy.copy(twin).asked and isinstance(copy.copy(twin), RecordingWorld)
