"""The same scene and the same motion under every supported version of MuJoCo."""

import mujoco
import numpy as np
import pytest

from scengen import load_task
from scengen.assets.box import Domino
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.compat import from_mjcf, set_damping, set_multiccd, to_mjcf
from scengen.drift.models import model_difference
from scengen.sim.scene_text import emit
from scengen.sim.world import World

JOINT_ANGLES = [
    -0.5395924734707225,
    -0.1150832750477033,
    0.24880379353529886,
    -2.7153365292298606,
    1.5744408452918535,
    1.9290176152554717,
    -2.071945715026398,
]
"""Joint angles after the motion below under MuJoCo 3.5.0 [rad]."""


def world():
    """The arm over an empty table."""
    return World.load(emit(table())[0])


def test_the_arm_moves_as_under_mujoco_3_5():
    moved = world()
    for k in range(200):
        moved.step(np.array([np.sin(0.03 * k), np.cos(0.02 * k), 0.2, 0.1, -0.2, 0.3, -1.0]))
    assert moved.arm.joint_pos == pytest.approx(JOINT_ANGLES, abs=2e-9)  # 4.0.0: 5e-10 after two seconds


@pytest.mark.parametrize("on", [True, False])
def test_multiple_contacts_of_convex_shapes_are_off_unless_the_text_enables_them(on):
    scene = table()
    set_multiccd(scene, on)
    scene.compile()
    text = to_mjcf(scene)
    assert ('multiccd="enable"' in text) == on and 'multiccd="disable"' not in text
    again = from_mjcf(text)
    again.compile()
    assert ('multiccd="enable"' in to_mjcf(again)) == on


@pytest.mark.parametrize("on", [True, False])
def test_a_cylinder_on_a_box_has_one_contact_unless_the_flag_allows_more(on):
    scene = table()
    set_multiccd(scene, on)
    pillar = scene.worldbody.add_body(pos=[0, 0, TABLE_TOP + 0.0499])
    pillar.add_freejoint()
    pillar.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.03, 0.05, 0])
    loaded = World.load(emit(scene)[0])
    loaded.step(loaded.idle)
    assert loaded.data.ncon >= 4 if on else loaded.data.ncon == 1


@pytest.mark.parametrize("task", ["domino_single", "pendulum_grasp", "seesaw_balance", "slide_catch"])
def test_poses_are_in_bodies_and_not_in_frames(task):
    text, lost = emit(load_task(task).draw("id", seed=0, index=0).scenario.build())
    assert "<frame" not in text and not lost


def test_damping_is_set_whatever_its_form():
    scene = table()
    body = scene.worldbody.add_body(pos=[0, 0, 2])
    body.add_geom(size=[0.1, 0, 0])
    set_damping(body.add_joint(name="hinge"), 0.25)
    assert scene.compile().dof_damping.tolist() == [0.25]


@pytest.mark.parametrize("mass", [0.05, 0.0501])
def test_another_mass_is_another_model(mass):
    models = []
    for each in (0.05, mass):
        scene = table()
        place(scene, Domino(mass=each), "tile", [0.1, 0.0, TABLE_TOP], yaw=0.3)
        models.append(World.load(emit(scene)[0]).model)
    found = model_difference(*models)
    assert found == "" if mass == 0.05 else found.startswith("mass of the body tile is")
