"""Events: what they change is part of the state, is the same for whoever steps, and is changed by nothing else."""

from dataclasses import dataclass

import mujoco
import numpy as np
import pytest

from scengen.assets.box import Cube
from scengen.assets.patch import TURNED_OVER, Patch
from scengen.assets.prop import BOX, TABLE_TOP, place, servo, table
from scengen.certificate import Check
from scengen.control.loop import Loop
from scengen.episode import Episode
from scengen.errors import NoEvent, UnknownName
from scengen.geometry import UP
from scengen.params import param
from scengen.scenario import Scenario
from scengen.sim import scene_text
from scengen.sim.embodiment import SUCTION
from scengen.sim.memory import remember
from scengen.sim.world import World
from scengen.skills.motion import facing_down, go_to, hold
from scengen.skills.suction import suck
from scengen.validate.certify import Trial
from scengen.validate.rebuilt import world_of
from scengen.validate.rollout import AT_REST, replay, run
from scengen.validate.settings import QUICK

JAMMED_FOR = 0.3
LID_MASS, LID_STIFFNESS, LID_DAMPING = 0.5, 200.0, 20.0


@dataclass(frozen=True, kw_only=True)
class Surprise(Scenario):
    """At a time of its own the gripper opens, the patch jumps and is turned over, and a cube is knocked."""

    when: float = param(0.5, "s", 0.0, 5.0)
    knock: float = param(0.0, "N", 0.0, 100.0)

    def build(self) -> mujoco.MjSpec:
        scene = table()
        remember(scene, "happened", "jammed_until")
        place(scene, Cube(), "cube", [0.1, 0.0, TABLE_TOP])
        place(scene, Patch(), "patch", [0.0, 0.2, TABLE_TOP], free=False)
        scene.body("patch").mocap = True
        lid = scene.worldbody.add_body(name="lid", pos=[-0.2, -0.25, TABLE_TOP + 0.2])
        lid.add_joint(name="lid/hinge", axis=[0, 1, 0], damping=LID_DAMPING, armature=0.05)
        lid.add_geom(size=[0.1, 0.1, 0.005], type=BOX, pos=[0.1, 0, 0], mass=LID_MASS)
        servo(scene, "lid/hinge", LID_STIFFNESS)
        return scene

    def success(self, world: World) -> bool:
        return world.memory["happened"] > 0 and world.com("cube")[2] > 1.0

    def events(self, world: World) -> None:
        if not world.memory["happened"] and world.time > self.when - 1e-9:
            world.memory["happened"] = 1.0
            world.memory["jammed_until"] = world.time + JAMMED_FOR
            world.move("patch", [0.0, -0.2, TABLE_TOP], TURNED_OVER)
            world.force("cube", [self.knock, 0.0, 0.0])
        world.arm.jam(world.time < world.memory["jammed_until"] - 1e-9)

    def pending(self, world: World) -> bool:
        return not world.memory["happened"]


def closing(world: World, scenario: Scenario, periods: int) -> Episode:
    """Command a closed gripper."""
    episode, action = Episode(scenario, world), np.array([0, 0, 0, 0, 0, 0, 1.0], np.float32)
    for _ in range(periods):
        episode.step(action)
    return episode


def span(world: World) -> float:
    """How far the fingers are apart [m]."""
    return float(np.ptp(world.arm.finger_pos))


@pytest.fixture
def world() -> World:
    return world_of(Surprise())


# --- memory -------------------------------------------------------------------------------


def test_memory_begins_with_zeros_and_does_so_again_after_a_reset(world):
    assert world.memory.names == ("happened", "jammed_until")
    closing(world, Surprise(), 60)
    assert world.memory["happened"] == 1.0 and world.memory["jammed_until"] == pytest.approx(0.5 + JAMMED_FOR)
    world.reset()
    assert [world.memory[name] for name in world.memory.names] == [0.0, 0.0]


def test_what_was_never_remembered_has_no_name(world):
    with pytest.raises(UnknownName, match="no memory named 'hapened' .did you mean 'happened'"):
        world.memory["hapened"]
    assert World.load(scene_text.emit(table())[0]).memory.names == ()


@pytest.mark.parametrize(
    "change",
    [
        lambda world: world.memory.__setitem__("happened", 1.0),
        lambda world: world.arm.jam(True),
        lambda world: world.move("patch", [0, 0, 1]),
        lambda world: world.force("cube", [1, 0, 0]),
        lambda world: world.launch("cube", [1, 0, 0]),
        lambda world: world.drive("lid/hinge", 1.0),
    ],
    ids=["memory", "jam", "move", "force", "launch", "drive"],
)
def test_only_events_change_the_course_of_things(world, change):
    before = world.state()
    with pytest.raises(NoEvent, match="outside of events"):
        change(world)
    with pytest.raises(RuntimeError), world.events():
        raise RuntimeError
    with pytest.raises(NoEvent):
        change(world)
    np.testing.assert_array_equal(world.state(), before)
    with world.events():
        change(world)
    assert (world.state() != before).any()


def test_only_mocap_bodies_are_moved(world):
    for body in ("cube", "nothing"):
        with world.events(), pytest.raises(UnknownName, match="known: patch"):
            world.move(body, [0, 0, 1])


# --- state --------------------------------------------------------------------------------


@pytest.mark.parametrize("periods", [20, 55, 100], ids=["before", "during", "after"])
def test_a_saved_state_continues_bit_by_bit_memory_jam_and_patch_included(world, periods):
    scenario = Surprise()
    closing(world, scenario, periods)
    saved = world.state()
    closing(world, scenario, 130 - periods)
    end, place = world.state(), world.pos("patch")
    other = world_of(scenario)
    for one in (world, other):
        one.restore(saved)
        closing(one, scenario, 130 - periods)
        np.testing.assert_array_equal(one.state(), end)
        np.testing.assert_array_equal(one.pos("patch"), place)


def test_recorded_actions_bring_the_same_events(world):
    scenario = Surprise()
    plan = run(scenario, world, lambda w: hold(w.arm, 1.2, 1.0), 4.0, until_settled=True)
    again = replay(scenario, world_of(scenario), plan.actions, 4.0, until_settled=True)
    assert plan.reason == again.reason == AT_REST
    np.testing.assert_array_equal(again.actions[: len(plan.actions)], plan.actions)
    assert plan.actions[60:110, 6].tolist() == [1.0] * 50, "what is recorded is what was commanded"


def test_the_patch_is_where_it_was_put_with_its_other_side_up(world):
    assert world.pos("patch").tolist() == [0.0, 0.2, TABLE_TOP] and world.tilt("patch") == 0.0
    closing(world, Surprise(), 55)
    assert world.pos("patch").tolist() == [0.0, -0.2, TABLE_TOP] and world.tilt("patch") == pytest.approx(np.pi)


# --- the jammed gripper -------------------------------------------------------------------


def test_a_jammed_jaw_opens_whatever_is_commanded_and_closes_again_afterwards(world):
    scenario = Surprise()
    closing(world, scenario, 50)
    closed = span(world)
    closing(world, scenario, round(JAMMED_FOR / Loop.PERIOD))
    opened = span(world)
    closing(world, scenario, 40)
    assert closed < 0.005 and opened > 0.05 and span(world) < 0.005


def test_the_jam_acts_in_every_physics_step_of_its_time_and_in_no_other(world):
    scenario, ends = Surprise(when=0.1), world.model.actuator_ctrlrange[-2:]
    record = []
    for period in range(60):
        with world.events():
            scenario.events(world)
        controls = np.zeros((world.loop.substeps, world.model.nu))
        world.loop.replay(np.array([[0, 0, 0, 0, 0, 0, 1.0]]), controls)
        opened = (controls[:, -2:] == [ends[0, 1], ends[1, 0]]).all(axis=1)
        assert opened.all() or not opened.any(), period
        record.append(bool(opened[0]))
    assert [k for k, jammed in enumerate(record) if jammed] == list(range(10, 40))


def test_somebody_elses_controller_is_overruled_too(world):
    """As in robosuite, which writes its own controls between mj_step1 and mj_step2."""
    fingers = [
        world.model.actuator(name).id
        for name in ("gripper0_right_gripper_finger_joint1", "gripper0_right_gripper_finger_joint2")
    ]
    for jammed, told in ((False, [0.0, 0.0]), (True, [0.04, -0.04])):
        with world.events():
            world.arm.jam(jammed)
        world.data.ctrl[fingers] = 0.0
        world.loop.watch(first=True)
        assert world.data.ctrl[fingers].tolist() == told


def test_a_jammed_suction_cup_lets_go():
    scenario = Surprise(when=5.0)
    world = world_of(scenario, SUCTION)
    top = world.pos("cube") + Cube().edge * UP
    for plan in (go_to(world.arm, top + 0.03 * UP, facing_down()), suck(world.arm, top, facing_down())):
        for action in plan:
            world.step(action)
    assert world.arm.sealed
    with world.events():
        world.arm.jam(True)
    for closed in (True, False):
        world.data.ctrl[-1] = 1.0  # by somebody else's controller
        world.loop.watch(first=True) if closed else world.step(world.idle)
        assert not world.arm.sealed and world.arm.grip > 0


# --- what is still to come ----------------------------------------------------------------


def test_no_episode_is_at_rest_before_the_last_event():
    ends = {
        when: run(
            Surprise(when=when), world_of(Surprise(when=when)), lambda w: hold(w.arm, 0.1), 8.0, until_settled=True
        )
        for when in (0.1, 3.0)
    }
    assert ends[0.1].reason == ends[3.0].reason == AT_REST
    assert ends[0.1].seconds < 2.5 and 3.5 <= ends[3.0].seconds < 4.5


def rest(scenario: Scenario) -> Check:
    """The rest check of a certificate."""
    trial = Trial(scenario, 5.0, QUICK, "panda_jaw")
    assert all(trial.check(name).passed for name in ("compiles", "overlap"))
    return trial.check("rest")


def test_what_an_event_sets_in_motion_is_no_lack_of_rest():
    assert rest(Surprise(knock=50.0)).passed


@dataclass(frozen=True, kw_only=True)
class Early(Surprise):
    """The cube is knocked before the event that the family tells of."""

    def events(self, world: World) -> None:
        super().events(world)
        if world.time < 0.1:
            world.force("cube", [self.knock, 0.0, 0.0])


def test_what_moves_before_the_first_event_is():
    assert "cube drifts" in rest(Early(knock=50.0)).reason


@dataclass(frozen=True, kw_only=True)
class Secretive(Surprise):
    """Does not say when its events are over."""

    def pending(self, world: World) -> bool:
        return Scenario.pending(self, world)


def test_of_a_family_that_does_not_say_the_whole_time_is_watched():
    scenario = Secretive(knock=50.0)
    assert "cube drifts" in rest(scenario).reason
    assert run(scenario, world_of(scenario), lambda w: hold(w.arm, 0.1), 4.0, until_settled=True).seconds == 4.0


# --- forces and servos --------------------------------------------------------------------


def test_a_force_is_an_impulse_of_one_period(world):
    """m v = (F - m g) t, off the table."""
    mass, force, dof = Cube().mass, 5.0, world.model.body("cube").dofadr[0]
    with world.events():
        world.force("cube", [0.0, 0.0, force])
    world.step_filtered(world.filter(world.idle))
    assert world.data.qvel[dof + 2] == pytest.approx((force / mass - 9.81) * Loop.PERIOD, rel=0.01)
    with world.events():
        pass
    world.step_filtered(world.filter(world.idle))
    assert world.data.qvel[dof + 2] == pytest.approx((force / mass - 2 * 9.81) * Loop.PERIOD, rel=0.01)


@pytest.mark.parametrize("goal", [-0.6, 0.9])
def test_a_servo_goes_where_it_is_driven_and_sags_by_the_torque_that_it_holds(goal):
    """A spring of stiffness k under a load: k (goal - angle) = m g l cos(angle), about y, which turns down."""
    world = world_of(Surprise())
    with world.events():
        world.drive("lid/hinge", goal)
    for _ in range(150):
        world.step_filtered(world.filter(world.idle))
    angle, rate = world.hinge("lid/hinge")
    assert abs(rate) < 1e-3
    assert LID_STIFFNESS * (angle - goal) == pytest.approx(LID_MASS * 9.81 * 0.1 * np.cos(angle), rel=0.01)


def test_only_joints_with_a_servo_are_driven(world):
    with world.events(), pytest.raises(UnknownName, match="did you mean 'lid/hinge'"):
        world.drive("lid/hing", 1.0)
