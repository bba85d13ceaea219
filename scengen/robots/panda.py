"""robosuite's Panda on its mount, composed with MjSpec from robosuite's own files (`files`).

robosuite is not imported. Names, masses, poses and everything that robosuite sets in Python instead of XML are the same
as in its compiled environments. A test compares them all.
"""

import functools
import math
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..compat import set_damping
from . import files
from .jaw import OVERLAP

JOINTS = 7
"""Number of joints of the arm."""

HOME: NDArray[np.float64] = np.array([0, np.pi / 16, 0, -np.pi / 2 - np.pi / 3, 0, np.pi - 0.2, np.pi / 4])
"""Joint angles after a reset [rad], shape (7,): robosuite's Panda.init_qpos, without its noise."""
WRIST_MIDDLE = math.pi / 4
"""Yaw at which a hand that points down in front of the robot has joint 7 in the middle of its range [rad]. After a
reset the yaw is 0 and that joint is at pi / 4. It turns back as the yaw grows; 160 deg remain each way."""
FINGERS: NDArray[np.float64] = np.array([0.020833, -0.020833])
"""Finger positions after a reset [m], shape (2,): robosuite's PandaGripper.init_qpos."""

HOME_HAND: NDArray[np.float64] = np.array([-0.10277, 0.0, 1.01104])
"""Position of a single arm's grip site after a reset [m], shape (3,), to 0.01 mm: `HOME` by the links' lengths."""
HOME_TILT = 0.12725
"""Angle by which a hand points ahead of straight down after a reset [rad]. Its fingers close along y."""
IN_HAND = "in_hand"
"""Name of a scene's custom number: the width of the body that the jaw of the first arm holds at the start [m]. Without
it, jaws start half open and empty."""
PRESS = 1e-4
"""Depth by which the pads of a jaw are in the body that it holds at the start [m]: else it would fall before they
touch."""

BASE: NDArray[np.float64] = np.array([-0.56, 0.0, 0.912])
"""Base position [m], shape (3,): Panda.base_xpos_offset of a table 0.8 m long (-0.16 - 0.8 / 2), mounted."""
BASE_QUAT: NDArray[np.float64] = np.array([1.0, 0.0, 0.0, 0.0])
"""Base orientation (wxyz). robosuite leaves a single arm, and two parallel ones, unturned, facing +x."""
ROBOTVIEW: NDArray[np.float64] = BASE + np.array([1.0, 0.0, 0.4])
"""Position of a single arm's camera `robotview`, which faces the arm and does not move [m], shape (3,): robot.xml."""
ARM_OFFSET = 0.25
"""Distance to the right of `BASE` at which the first of two arms stands, and to the left for the second [m]: the layout
"parallel" of robosuite's two-arm environments."""
MAX_ARMS = 2
"""Largest number of arms of a robot: robosuite has no layout for more."""
CONTACT_FREE_LINKS = (("link0", "link1"), ("link2", "link4"), ("link3", "link5"))
"""Pairs of links of an arm whose contacts are left out. Their hulls are so close that MuJoCo would look for contacts at
every step, but no posture within the joints' ranges, nor 0.3 rad beyond, makes them touch. Leaving them out changes no
bit and saves some 5 % of a step."""
MOUNT: NDArray[np.float64] = np.array([0.0, 0.0, 0.01])
"""Position of the mount in the base's frame [m], shape (3,): minus RethinkMount.top_offset."""

ARMATURE = tuple(5.0 / (i + 1) for i in range(JOINTS))
"""Rotor inertia of each joint [kg m^2]: robosuite's RobotModel.__init__."""
FRICTIONLOSS = 0.1
"""Dry friction of each joint [N m]: robosuite's RobotModel.__init__."""
DAMPING = (0.1, 0.1, 0.1, 0.1, 0.1, 0.01, 0.01)
"""Viscous friction of each joint [N m s/rad]: robosuite's Panda.__init__."""

SHOULDER: NDArray[np.float64] = BASE + np.array([0.0, 0.0, 0.333])
"""World point about which the arm swings [m], shape (3,): joints 1 and 2 meet there (link1 in robot.xml)."""
REACH = math.hypot(0.316, 0.0825) + math.hypot(0.0825, 0.384) + math.hypot(0.088, 0.1065 + 0.097)
"""Distance from `SHOULDER` that no posture exceeds for the grip site [m].

Triangle inequality over three rigid stretches, with the link offsets of robot.xml and panda_gripper.xml.
Turning joint 3, 5 or 7 moves nothing along its own axis, so each of these stretches has a fixed length:

* shoulder to elbow (link4): 0.316 along the axis of joint 3, then 0.0825 across it;
* elbow to wrist (link6): 0.0825 across the axis of joint 5, then 0.384 along it;
* wrist to grip site: 0.088 across the axis of joint 7, then 0.1065 (hand) + 0.097 (eef) along it.

Joint limits are ignored, so the bound is not attained. It holds for the grip site; the fingertips are 1 cm farther.
"""


@dataclass(frozen=True)
class Names:
    """robosuite's names for the parts of one robot and its hand."""

    number: int = 0
    """Number of the arm, from 0."""

    @property
    def arm(self) -> str:
        """Prefix of the names of the arm's parts."""
        return f"robot{self.number}_"

    @property
    def hand(self) -> str:
        """Prefix of the names of the hand's parts."""
        return f"gripper{self.number}_right_"

    @property
    def mount(self) -> str:
        """Prefix of the names of the pedestal's parts."""
        return f"fixed_mount{self.number}_"

    @property
    def joints(self) -> list[str]:
        """The arm's joints, from the base on."""
        return [f"{self.arm}joint{i + 1}" for i in range(JOINTS)]

    @property
    def motors(self) -> list[str]:
        """The arm's motors, in the order of the joints."""
        return [f"{self.arm}torq_j{i + 1}" for i in range(JOINTS)]

    @property
    def finger_joints(self) -> list[str]:
        """The jaw's two joints."""
        return [f"{self.hand}finger_joint{i}" for i in (1, 2)]

    @property
    def finger_motors(self) -> list[str]:
        """The jaw's two motors."""
        return [f"{self.hand}gripper_finger_joint{i}" for i in (1, 2)]

    @property
    def base(self) -> str:
        """Body that stands on the mount."""
        return f"{self.arm}base"

    @property
    def controller_site(self) -> str:
        """Site whose axes are the controller's."""
        return f"{self.arm}right_center"

    @property
    def grip_site(self) -> str:
        """Site that the controller moves: between the finger tips, or in the middle of a cup's lip."""
        return f"{self.hand}grip_site"

    @property
    def wrist_site(self) -> str:
        """Site of the force and torque sensors."""
        return f"{self.hand}ft_frame"

    @property
    def wrist(self) -> str:
        """Body that carries the hand."""
        return f"{self.arm}right_hand"

    @property
    def load(self) -> str:
        """Body of a load at the wrist."""
        return f"{self.arm}load"

    @property
    def cup(self) -> str:
        """Actuator of a suction cup."""
        return f"{self.hand}suction"

    @property
    def finger_bodies(self) -> list[tuple[str, str]]:
        """Bodies of the jaw's two fingers: the pad and the rest of each."""
        return [
            (f"{self.hand}finger_joint{i}_tip", f"{self.hand}{side}finger") for i, side in ((1, "left"), (2, "right"))
        ]

    @property
    def cup_pads(self) -> str:
        """Body of a suction cup's four pads."""
        return f"{self.hand}suction_pad"

    @property
    def first_pad(self) -> str:
        """First of a suction cup's four pads."""
        return f"{self.hand}pad0_collision"


def bases(arms: int) -> NDArray[np.float64]:
    """Base positions in the order of the arms [m], shape (arms, 3): one in the middle, or two side by side."""
    sides = (0.0,) if arms == 1 else (-ARM_OFFSET, ARM_OFFSET)
    return BASE + np.array([[0.0, side, 0.0] for side in sides])


def attach(
    scene: mujoco.MjSpec,
    visual: bool = False,
    hand: mujoco.MjSpec | None = None,
    number: int = 0,
    base: ArrayLike = BASE,
) -> None:
    """Add an arm to `scene`, named and placed as in robosuite's table environments.

    Without `visual` the robot is bare collision geometry: the same physics to the bit, compiled 20 times faster. It
    also lacks the wrist's force and torque sensors, which cost 4 % of a step and influence nothing. Sites and cameras
    have no measurable cost and stay.

    Args:
        scene: the scene that the arm is added to.
        visual: add visual geometry.
        hand: a spec with a body "right_gripper" that replaces the two-finger jaw (see `suction`).
        number: number of the arm, which its names contain; arms are added in the order of their numbers.
        base: position of the arm's base [m], see `bases`.
    """
    arm, mount, hand = _arm(visual).copy(), _mount(visual).copy(), (hand or _jaw(visual)).copy()
    # Arm first: a part that is attached to it earlier gets its prefix too (robot0_gripper0_ ...).
    place = scene.worldbody.add_frame(pos=np.asarray(base, float).tolist(), quat=BASE_QUAT.tolist())
    names = Names(number)
    place.attach_body(arm.body("base"), names.arm, "")
    foot, wrist = scene.body(names.base), scene.body(names.wrist)
    foot.add_frame().attach_body(mount.body("base"), names.mount, "")
    wrist.add_frame().attach_body(hand.body("right_gripper"), names.hand, "")
    for one, other in CONTACT_FREE_LINKS:
        scene.add_exclude(bodyname1=names.arm + one, bodyname2=names.arm + other)


def arms(model: mujoco.MjModel) -> list[Names]:
    """Names of the arms in a model, in their order."""
    every = (Names(number) for number in range(MAX_ARMS))
    return [names for names in every if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, names.base) >= 0]


def fingers(model: mujoco.MjModel, names: Names) -> list[int]:
    """Indices of the finger joints in qpos; empty for a hand without a jaw."""
    found = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in names.finger_joints]
    return [int(model.jnt_qposadr[joint]) for joint in found if joint >= 0]


def width_in_hand(model: mujoco.MjModel) -> float | None:
    """Width of the body that the jaw of the first arm holds at the start [m], or None. See `IN_HAND`."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, IN_HAND)
    return None if number < 0 else float(model.numeric_data[model.numeric_adr[number]])


def start_fingers(model: mujoco.MjModel, names: Names) -> NDArray[np.float64]:
    """Positions of the finger joints after a reset [m], shape (2,), or (0,) for a hand without a jaw."""
    width = width_in_hand(model) if names.number == 0 else None
    pair = FINGERS if width is None else ((width + OVERLAP) / 2 - PRESS) * np.array([1.0, -1.0])
    return pair[: len(fingers(model, names))]


@functools.cache
def _arm(visual: bool) -> mujoco.MjSpec:
    """The seven links, as robosuite's Python code sets them."""
    arm = _load("robots/panda/robot.xml", visual)
    for i in range(JOINTS):
        joint = arm.joint(f"joint{i + 1}")
        joint.armature = ARMATURE[i]
        joint.frictionloss = FRICTIONLOSS
        set_damping(joint, DAMPING[i])
    return arm


@functools.cache
def _mount(visual: bool) -> mujoco.MjSpec:
    """The pedestal below the arm. robosuite overwrites the position in the file by `MOUNT`."""
    mount = _load("bases/rethink_mount.xml", visual)
    mount.body("base").pos = MOUNT
    return mount


@functools.cache
def _jaw(visual: bool) -> mujoco.MjSpec:
    """The two-finger gripper."""
    jaw = _load("grippers/panda_gripper.xml", visual)
    if not visual:
        for sensor in list(jaw.sensors):
            jaw.delete(sensor)
    return jaw


def _load(path: str, visual: bool) -> mujoco.MjSpec:
    """Parse one of robosuite's asset files, in radians, because robosuite includes all of them in radians.

    Raises:
        NoRobot: it, or one of the meshes that are used, is missing or another one.
    """
    spec = mujoco.MjSpec.from_file(str(files.checked(path)))
    spec.compiler.degree = False
    if not visual:
        strip_visual(spec)
    for mesh in spec.meshes:
        files.checked(f"{PurePosixPath(path).parent}/{mesh.file}")
    return spec


FOLDERS = {
    prefix: folder
    for names in map(Names, range(MAX_ARMS))
    for prefix, folder in ((names.hand, "grippers"), (names.mount, "bases"), (names.arm, "robots/panda"))
}
"""Folder of the meshes of each part among `files`, by the prefix of their names."""


def mesh_file(name: str, file: str) -> Path:
    """Path of one of the robot's meshes on this machine.

    Args:
        name: name of the mesh.
        file: the file that its MJCF names.

    Raises:
        NoRobot: it is missing or another one.
    """
    folder = next(folder for prefix, folder in FOLDERS.items() if name.startswith(prefix))
    return files.checked(f"{folder}/{file}")


def strip_visual(spec: mujoco.MjSpec) -> None:
    """Delete visual geoms (group 1, no collisions), and the assets that nothing uses afterwards.

    Raises ValueError if such a geom gives its body inertia, because then the physics would change.
    """
    for geom in list(spec.geoms):
        if geom.group == 1 and geom.contype == 0 and geom.conaffinity == 0:
            if _weighs(spec, geom):
                raise ValueError(
                    f"visual geom {geom.name!r} gives body {geom.parent.name!r} inertia and cannot be "
                    "stripped; set its mass to 0 or give the body explicit inertia"
                )
            spec.delete(geom)
    meshes = {geom.meshname for geom in spec.geoms}
    _delete_unused(spec, spec.meshes, meshes)
    looks = [*spec.geoms, *spec.sites, *spec.tendons, *spec.skins, *spec.flexes]
    _delete_unused(spec, spec.materials, {look.material for look in looks})
    textures = {name for material in spec.materials for name in material.textures}
    _delete_unused(spec, spec.textures, textures)


def _weighs(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Whether the compiler would count `geom` in the inertia of its body."""
    low, high = spec.compiler.inertiagrouprange
    inferred = geom.parent.name != "world" and not geom.parent.explicitinertial
    massless = geom.mass == 0 or (math.isnan(geom.mass) and geom.density == 0)
    return inferred and not massless and low <= geom.group <= high


def _delete_unused(spec: mujoco.MjSpec, assets: list, used: set[str]) -> None:
    """Delete from `spec` the assets whose names are not in `used`."""
    for asset in list(assets):
        if asset.name not in used:
            spec.delete(asset)
