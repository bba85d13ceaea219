"""What the robot's description leaves out changes nothing."""

import itertools

import mujoco
import numpy as np
import pytest

from scengen.robots import panda

BEYOND = 0.3
"""How far outside the joints' ranges links are looked at [rad]: the limits are soft, but not that soft."""
POSTURES = 60
"""Angles of each joint."""


@pytest.mark.parametrize("one, other", panda.CONTACT_FREE_LINKS)
def test_links_whose_contacts_are_left_out_never_touch(one, other):
    spec = mujoco.MjSpec()
    panda.attach(spec)
    for pair in list(spec.excludes):
        spec.delete(pair)
    model = spec.compile()
    data = mujoco.MjData(model)
    names = panda.Names()
    pair = {model.body(names.arm + one).id, model.body(names.arm + other).id}
    between = [model.joint(names.joints[i]) for i in range(*(int(link[-1]) for link in (one, other)))]
    angles = [np.linspace(joint.range[0] - BEYOND, joint.range[1] + BEYOND, POSTURES) for joint in between]
    data.qpos[: panda.JOINTS] = panda.HOME
    for posture in itertools.product(*angles):
        for joint, angle in zip(between, posture, strict=True):
            data.qpos[joint.qposadr] = angle
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        touching = [set(model.geom_bodyid[contact.geom].tolist()) for contact in data.contact[: data.ncon]]
        assert pair not in touching, posture
