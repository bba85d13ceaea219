"""A suction cup on the Panda's flange, built here because robosuite has no suction gripper.

        flange      The cup consists of four box pads in a separate body. MuJoCo's adhesion acts on every contact of
          ||        a body, and a single box or cylinder drops a thin plate at 20 N: too few contact points hold it.
         _||_       The pull is a fixed force, unlike a vacuum. The control loop therefore applies it only while at
        [][]        least three of the pads touch something (`osc.MIN_SEALED_PADS`): a cup pulls only with a closed lip.

Names and frames are those of robosuite's Panda gripper: body "right_gripper", body "eef" with the grip site (here in
the middle of the pads' lower face, z out of the hand), and the wrist's force and torque sensors.
"""

import functools

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from . import panda

PULL = 40.0
"""Force that holds a sealed cup to a flat face [N]: a 30 mm cup at 0.6 bar below air pressure pulls 42 N."""
LENGTH = 0.097
"""Distance from the flange to the lower face of the pads [m]. The grip site of robosuite's jaw is at the same
distance."""
PAD = 0.012
"""Edge of one square pad [m]."""
PITCH = 0.015
"""Distance between the middles of neighbouring pads [m]. With `PAD`, the cup covers a square of 27 mm."""
CUP_HALF_WIDTH = (PITCH + PAD) / 2
"""Distance that the cup reaches to each side of the grip site [m]. A face must extend at least that far to take all
pads."""
TORQUE = PULL / 2 * (CUP_HALF_WIDTH + ((PITCH - PAD) / 2) ** 2 / CUP_HALF_WIDTH)
"""Torque that peels the cup off [N m]. The pull acts equally on every corner of a pad. Under a torque the pressure
falls evenly across the cup until it is zero at its edge. Corners that have come off no longer pull, and the others
follow."""
LEAKY = 1.0
"""First user number of geoms on which no lip closes, such as ribbed or porous ones. A cup on them does not pull."""
TUBE = 0.011
"""Radius of the tube between flange and bellows [m]."""
MASS = 0.3
"""Mass of the tool [kg]: robosuite's Panda hand without its fingers."""

_PAD_THICKNESS = 0.004
"""Thickness of the pads [m]."""
_RUBBER = (0.13, 0.13, 0.15, 1.0)
"""Colour of bellows and pads."""
_METAL = (0.75, 0.76, 0.78, 1.0)
"""Colour of flange plate and tube."""
_STEM = ((0.031, 0.0, 0.020, _METAL), (TUBE, 0.020, 0.078, _METAL), (0.017, 0.078, LENGTH - _PAD_THICKNESS, _RUBBER))
"""Radius, lower and upper end along the hand's axis [m] and colour of flange plate, tube and bellows."""


def attach(scene: mujoco.MjSpec, visual: bool = False, number: int = 0, base: ArrayLike = panda.BASE) -> None:
    """Add a Panda with a suction cup to `scene`. See `panda.attach`."""
    panda.attach(scene, visual, _cup(visual), number, base)


def xml() -> str:
    """The tool alone as MJCF, including visual geometry and sensors."""
    spec = _cup(True).copy()
    spec.compile()
    return spec.to_xml()


@functools.cache
def _cup(visual: bool) -> mujoco.MjSpec:
    """The tool alone."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.compiler.autolimits = True
    hand = spec.worldbody.add_body(name="right_gripper", quat=[0.707107, 0, 0, -0.707107])
    hand.add_site(name="ft_frame", size=[0.01, 0.01, 0.01], rgba=[1, 0, 0, 1], group=1)
    hand.explicitinertial = True
    hand.mass, hand.ipos = MASS, np.array([0.0, 0.0, 0.03])
    hand.inertia = np.array([3e-4, 3e-4, 1.5e-4])  # a cylinder, 60 x 80 mm
    for i, (radius, low, high, rgba) in enumerate(_STEM):
        _stem_piece(hand, f"hand_collision_{i}", radius, low, high)
        if visual:
            look = _stem_piece(hand, f"hand_visual_{i}", radius, low, high)
            look.group, look.contype, look.conaffinity, look.mass = 1, 0, 0, 0
            look.rgba = np.array(rgba, np.float32)
    _sites(hand)
    pad = hand.add_body(name="suction_pad", pos=[0, 0, LENGTH])
    pad.explicitinertial = True
    pad.mass, pad.ipos, pad.inertia = 0.01, np.array([0.0, 0.0, -_PAD_THICKNESS / 2]), np.array([1e-6, 1e-6, 2e-6])
    for i in range(4):  # the control loop expects consecutive ids of the four pads
        _pad(pad, f"pad{i}_collision", i)
    if visual:
        for i in range(4):
            look = _pad(pad, f"pad{i}_visual", i)
            look.group, look.contype, look.conaffinity, look.mass = 1, 0, 0, 0
            look.rgba = np.array(_RUBBER, np.float32)
    pull = spec.add_actuator(name="suction", trntype=mujoco.mjtTrn.mjTRN_BODY, target="suction_pad")
    pull.ctrllimited, pull.ctrlrange = True, np.array([0.0, 1.0])
    pull.gainprm[0] = PULL
    if visual:
        for kind, name in ((mujoco.mjtSensor.mjSENS_FORCE, "force_ee"), (mujoco.mjtSensor.mjSENS_TORQUE, "torque_ee")):
            spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="ft_frame")
    return spec


def _stem_piece(body: mujoco.MjsBody, name: str, radius: float, low: float, high: float) -> mujoco.MjsGeom:
    """A piece of the stem between two positions on the hand's axis [m]."""
    return body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[radius, (high - low) / 2, 0],
        pos=[0, 0, (high + low) / 2],
    )


def _pad(body: mujoco.MjsBody, name: str, quarter: int) -> mujoco.MjsGeom:
    """One pad, with its lower face in the plane of the grip site."""
    x, y = ((1, 1), (-1, 1), (-1, -1), (1, -1))[quarter]
    return body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[PAD / 2, PAD / 2, _PAD_THICKNESS / 2],
        pos=[x * PITCH / 2, y * PITCH / 2, -_PAD_THICKNESS / 2],
        friction=[1.0, 0.005, 0.0001],
        condim=4,
        solref=(0.005, 1.0),
    )


def _sites(hand: mujoco.MjsBody) -> None:
    """The sites that robosuite looks for in every gripper."""
    eef = hand.add_body(name="eef", pos=[0, 0, LENGTH])
    eef.add_site(name="grip_site", size=[0.01, 0.01, 0.01], rgba=[1, 0, 0, 0.5], group=1)
    turned = {"ee_x": [0.707105, 0, 0.707108, 0], "ee_y": [0.707105, 0.707108, 0, 0], "ee_z": [1, 0, 0, 0]}
    for i, (name, quat) in enumerate(turned.items()):
        pos, rgba = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]
        pos[i], rgba[i] = 0.1, 1.0
        eef.add_site(
            name=name, pos=pos, quat=quat, size=[0.005, 0.1, 0], rgba=rgba, type=mujoco.mjtGeom.mjGEOM_CYLINDER, group=1
        )
    eef.add_site(
        name="grip_site_cylinder",
        size=[0.005, 10, 0],
        rgba=[0, 1, 0, 0.3],
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        group=1,
    )
