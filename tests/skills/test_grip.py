"""Where a jaw takes hold: widths are those of the solid, whatever it is made of and however it lies."""

import math

import mujoco
import numpy as np
import pytest

from scengen.assets.prop import TABLE_TOP, place, solid, table
from scengen.assets.ycb import Ycb
from scengen.errors import GaveUp
from scengen.geometry import UP, heading, quat
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.skills.grip import MAX_WIDTH, best_grip, extent, take

CAN, TIN, PLATE, FOAM = 3, 8, 12, 15
"""Indices among the objects of the YCB set."""


def scene_with(item: int, yaw: float = 0.0, turn: tuple[str, float] | None = None, height: float = 0.0) -> World:
    """A world with one object of the set, turned about an axis of its own."""
    scene = table()
    place(scene, Ycb(item=item), "thing", [0.02, 0.1, TABLE_TOP + height], math.radians(yaw))
    if turn:
        body, whole = scene.body("thing"), np.empty(4)
        mujoco.mju_mulQuat(whole, np.array(body.quat), np.array(quat(*turn)))
        body.quat = whole
    return World.load(scene_text.emit(scene)[0])


@pytest.mark.parametrize(
    ("kind", "size", "along"),
    [
        ("BOX", [0.01, 0.02, 0.03], lambda x, y, z: 0.01 * x + 0.02 * y + 0.03 * z),
        ("SPHERE", [0.02], lambda x, y, z: 0.02),
        ("CAPSULE", [0.01, 0.03], lambda x, y, z: 0.01 + 0.03 * z),
        ("CYLINDER", [0.02, 0.03], lambda x, y, z: 0.02 * math.hypot(x, y) + 0.03 * z),
    ],
)
def test_a_solid_reaches_as_far_as_its_support_function_says(kind, size, along):
    scene, turn = table(), quat("y", 0.7)
    body = scene.worldbody.add_body(name="thing", pos=[0.1, 0.2, 1.0], quat=turn)
    solid(body, "solid", size, type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"))
    world = World.load(scene_text.emit(scene)[0])
    for direction in (UP, heading(20.0), heading(130.0)):
        low, high = extent(world, "thing", direction)
        half = along(*np.abs(world.rot("thing").T @ direction))
        assert (low + high) / 2 == pytest.approx(world.pos("thing") @ direction, abs=1e-9)
        assert (high - low) / 2 == pytest.approx(half, abs=1e-9)


def test_a_mesh_reaches_as_far_as_its_vertices():
    scene = table()
    scene.add_mesh(name="wedge", uservert=[0, 0, 0, 0.06, 0, 0, 0, 0.04, 0, 0, 0, 0.02])
    body = scene.worldbody.add_body(name="thing", pos=[0.1, 0.2, 1.0], quat=quat("z", math.pi / 2))
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="wedge")
    world = World.load(scene_text.emit(scene)[0])
    assert extent(world, "thing", np.array([0.0, 1.0, 0.0])) == pytest.approx((0.2, 0.26))
    assert extent(world, "thing", np.array([1.0, 0.0, 0.0])) == pytest.approx((0.06, 0.1))
    assert extent(world, "thing", UP) == pytest.approx((1.0, 1.02))


@pytest.mark.parametrize("yaw", [0.0, 30.0, 100.0])
def test_a_tin_is_taken_across_its_narrow_side_near_its_top(yaw):
    world = scene_with(TIN, yaw)
    grip = best_grip(world.arm, "thing")
    assert grip.width == pytest.approx(0.052) and abs(grip.closing @ heading(yaw)) == pytest.approx(1.0)
    assert grip.at == pytest.approx([0.02, 0.1, TABLE_TOP + 0.0835 - 0.028])


@pytest.mark.parametrize("roll", [0.0, 0.5, math.pi / 4])
def test_a_can_that_lies_is_taken_across_its_axis_however_far_it_has_rolled(roll):
    scene = table()
    place(scene, Ycb(item=CAN), "thing", [0.0, 0.1, TABLE_TOP + 0.0339])
    lying, whole = quat("y", math.pi / 2), np.empty(4)
    mujoco.mju_mulQuat(whole, np.array(lying), np.array(quat("z", roll)))
    scene.body("thing").quat = whole
    world = World.load(scene_text.emit(scene)[0])
    grip = best_grip(world.arm, "thing")
    assert grip.width == pytest.approx(0.0678, abs=1e-4) and abs(grip.closing[1]) == pytest.approx(1.0)


def test_what_is_too_wide_every_way_has_no_grip():
    plate, flat = scene_with(PLATE), scene_with(TIN, turn=("y", math.pi / 2), height=0.026)
    assert min(0.0835, 0.097) > MAX_WIDTH and best_grip(plate.arm, "thing") is best_grip(flat.arm, "thing") is None


@pytest.mark.parametrize("yaw", [20.0, 70.0])
def test_of_two_equal_grips_it_is_the_one_that_turns_the_hand_less(yaw):
    """The hand closes along y at the start."""
    world = scene_with(FOAM, yaw, turn=("x", math.pi / 2), height=0.0375)
    grip = best_grip(world.arm, "thing")
    assert grip.width == pytest.approx(0.05)
    assert abs(grip.closing @ heading(110.0 if yaw < 45.0 else 70.0)) == pytest.approx(1.0)


@pytest.mark.parametrize("item", [CAN, TIN, FOAM])
def test_what_has_a_grip_can_be_lifted(item):
    world = scene_with(item, 40.0)
    for action in take(world.arm, "thing"):
        world.step(action)
    assert world.com("thing")[2] > TABLE_TOP + 0.10


def test_what_has_none_is_given_up():
    world = scene_with(PLATE)
    with pytest.raises(GaveUp, match="no jaw can take it"):
        next(take(world.arm, "thing"))
