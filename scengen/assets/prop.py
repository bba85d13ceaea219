"""Props and the table: base class of all assets, and functions that add solid geoms and place assets in a scene."""

import abc
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ..compat import set_multiccd
from ..errors import UnknownName
from ..geometry import UP, about_y, axes, compound, quat
from ..params import check_bounds
from ..robots.panda import HOME_HAND, HOME_TILT, IN_HAND
from ..robots.suction import LEAKY

TABLE_TOP = 0.8
"""Height of the table top [m]: robosuite's TableArena, `table_offset`."""
TABLE_HALF = 0.4
"""Half the edge of the table top, which reaches from -0.4 to 0.4 m in x and y [m]: robosuite's TableArena,
`table_full_size`."""

STIFF = (0.005, 1.0)
"""Contact time constant [s] and damping ratio of every prop. At MuJoCo's default of 0.02 s a tile 80 mm high and 3 mm
thick falls over by itself, and tiles sink 9 mm into each other in a cascade. At 0.005 s neither happens."""
PRIORITY = 1
"""Contact priority of every prop, above the table's and the robot's 0. Without it MuJoCo takes the larger friction
of a pair and mixes the stiffnesses, so that a prop's own friction and `STIFF` would have no effect on the table."""

BOX = mujoco.mjtGeom.mjGEOM_BOX
Rgba = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class Prop(abc.ABC):
    """Base class of every asset: a frozen dataclass of parameters that fills one body with geoms.

    The origin of the body is the point where the asset stands on the ground, unless its docstring says otherwise.
    """

    def __post_init__(self) -> None:
        check_bounds(self)

    def spec(self) -> mujoco.MjSpec:
        """A spec with one top-level body named "body"."""
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        self.fill(spec.worldbody.add_body(name="body"), spec)
        return spec

    @property
    def material(self) -> str:
        """Hash of ingredients other than parameters, such as a mesh, on which ids of scenarios depend; empty if it has
        none."""
        return ""

    @abc.abstractmethod
    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        """Add geoms, joints and child bodies to `body`, and meshes to `spec`."""


def solid(
    body: mujoco.MjsBody,
    name: str,
    size: ArrayLike,
    pos: ArrayLike = (0.0, 0.0, 0.0),
    *,
    type: mujoco.mjtGeom = BOX,
    quat: ArrayLike = (1.0, 0.0, 0.0, 0.0),
    friction: float = 1.0,
    mass: float | None = None,
    density: float | None = None,
    rgba: Sequence[float] = (0.5, 0.5, 0.5, 1.0),
    condim: int = 4,
    solref: tuple[float, float] = STIFF,
    priority: int = PRIORITY,
    group: int = 0,
    leaky: bool = False,
) -> mujoco.MjsGeom:
    """Add a geom that collides: stiff, with its own sliding friction against everything that touches it.

    Args:
        size: size in MuJoCo's convention, half lengths for boxes [m].
        friction: sliding friction; torsional and rolling friction are MuJoCo's defaults.
        mass: mass of the geom [kg]. Without it `density` counts.
        density: density of the geom [kg/m^3], by default MuJoCo's 1000.
        condim: 4, so that a face resists turning on the spot; 3 where that has no effect and only costs time.
        leaky: whether no suction cup can hold the geom, see `robots.suction.LEAKY`.
    """
    geom = body.add_geom(name=name, type=type)
    full = np.zeros(3)
    full[: len(np.asarray(size))] = size
    geom.size, geom.pos, geom.quat = full, np.asarray(pos, float), np.asarray(quat, float)
    geom.friction, geom.condim = np.array([friction, 0.005, 0.0001]), condim
    geom.solref, geom.priority, geom.group = np.array(solref), priority, group
    geom.rgba = np.array(rgba, np.float32)
    if mass is not None:
        geom.mass = mass
    if density is not None:
        geom.density = density
    if leaky:
        geom.userdata = [LEAKY]
    return geom


def shown(
    body: mujoco.MjsBody,
    name: str,
    rgba: Sequence[float],
    *,
    type: mujoco.mjtGeom = BOX,
    size: ArrayLike = (0.0, 0.0, 0.0),
    pos: ArrayLike = (0.0, 0.0, 0.0),
    quat: ArrayLike = (1.0, 0.0, 0.0, 0.0),
) -> mujoco.MjsGeom:
    """Add a visual geom, without collisions and without mass."""
    geom = body.add_geom(name=name, type=type, group=1, contype=0, conaffinity=0, mass=0)
    geom.size, geom.pos, geom.quat = np.asarray(size, float), np.asarray(pos, float), np.asarray(quat, float)
    geom.rgba = np.array(rgba, np.float32)
    return geom


def table() -> mujoco.MjSpec:
    """A floor and robosuite's table, with the physics options that every scene carries.

    The options are robosuite's (models/assets/base.xml: elliptic cone, impratio 20, air, Newton's method) with a time
    step of 2 ms. With impratio 20 the conjugate gradient solver reaches its limit of 100 iterations in some steps of
    most tasks, and takes a fifth more time over the certificates of 35 tasks (MuJoCo 3.5.0: 241 and 200 CPU seconds).
    Two families use it nevertheless; their files give the reason.
    """
    scene = mujoco.MjSpec()
    option = scene.option
    option.timestep = 0.002
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 20.0
    option.density, option.viscosity = 1.2, 2e-5
    set_multiccd(scene, False)
    scene.compiler.degree = False
    scene.compiler.autolimits = True
    _add_visuals(scene)
    world = scene.worldbody
    world.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[3, 3, 0.125], rgba=[0.55, 0.58, 0.62, 1])
    body = world.add_body(name="table", pos=[0, 0, TABLE_TOP - 0.025])
    body.add_geom(
        name="table_top",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[TABLE_HALF, TABLE_HALF, 0.025],
        friction=[1.0, 0.005, 0.0001],
        rgba=[0.78, 0.74, 0.68, 1],
    )
    return scene


def _add_visuals(scene: mujoco.MjSpec) -> None:
    """Add sky, light and the cameras of robosuite's TableArena, which only pictures use."""
    sky = scene.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=64, height=64)
    sky.builtin = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
    sky.rgb1, sky.rgb2 = np.array([0.9, 0.9, 1.0]), np.array([0.45, 0.52, 0.62])
    visual = getattr(scene.visual, "global")
    visual.offwidth, visual.offheight = 1280, 960
    scene.visual.headlight.ambient = np.full(3, 0.35, np.float32)
    scene.visual.map.znear = 0.001
    world = scene.worldbody
    world.add_light(pos=[0.6, -0.8, 2.4], dir=[-0.3, 0.4, -1.2], diffuse=[0.6, 0.6, 0.6], castshadow=True)
    for name, pos, turn in CAMERAS:
        world.add_camera(name=name, pos=pos, quat=turn)


CAMERAS = (
    ("frontview", (1.6, 0, 1.45), (0.56, 0.43, 0.43, 0.56)),
    ("birdview", (-0.2, 0, 3.0), (0.7071, 0, 0, 0.7071)),
    ("agentview", (0.5, 0, 1.35), (0.653, 0.271, 0.271, 0.653)),
    ("sideview", (-0.056518, 1.276122, 1.487957), (0.009905, 0.006878, 0.591223, 0.806418)),
)
"""Name, position [m] and orientation (wxyz) of robosuite's TableArena cameras."""


def aim(scene: mujoco.MjSpec, camera: str, eye: ArrayLike, at: ArrayLike) -> None:
    """Move a camera of the scene, and point it at a place with its upper side up.

    Args:
        camera: its name.
        eye: its position [m].
        at: the place that is in the middle of its picture, not straight below or above it [m].
    """
    found, turn = scene.camera(camera), np.empty(4)
    back = np.asarray(eye, float) - np.asarray(at, float)  # a camera looks along its own -z, with x to the right
    right = np.cross(UP, back)
    mujoco.mju_mat2Quat(turn, axes(right / np.linalg.norm(right), back / np.linalg.norm(back)).ravel())
    found.pos, found.quat = np.asarray(eye, float), turn


def place(
    scene: mujoco.MjSpec,
    asset: Prop,
    name: str,
    pos: ArrayLike,
    yaw: float = 0.0,
    free: bool = True,
    turn: ArrayLike | None = None,
) -> None:
    """Add `asset` to the scene as body `name`, with its origin at `pos` [m].

    Args:
        yaw: rotation about the vertical [rad].
        free: whether the body gets a free joint, named `<name>_free`; else it is fixed.
        turn: orientation (wxyz), in place of `yaw`.
    """
    body = scene.worldbody.add_frame().attach_body(asset.spec().body("body"), f"{name}/", "")
    body.name = name
    carry(body, pos, quat("z", yaw) if turn is None else turn)
    if free:
        body.add_freejoint(name=f"{name}_free")


def remove(scene: mujoco.MjSpec, name: str) -> None:
    """Take a body out of a scene, as in an ablation.

    Raises:
        UnknownName: the scene does not have it.
    """
    body = scene.body(name)
    if body is None:
        raise UnknownName("body", name, [known.name for known in scene.bodies])
    scene.delete(body)


def place_in_hand(scene: mujoco.MjSpec, asset: Prop, name: str, width: float, offset: ArrayLike) -> None:
    """Add `asset` to the scene as a free body that the jaw of the first arm holds at the start.

    Args:
        width: width of the asset between the fingers [m]. They close along its y axis.
        offset: position of its origin from the grip site, in its own axes, of which z points back into the hand [m].
    """
    pos = HOME_HAND + about_y(-HOME_TILT) @ np.asarray(offset, float)
    place(scene, asset, name, pos, turn=quat("y", -HOME_TILT))
    scene.add_numeric(name=IN_HAND, data=[width], size=1)


def carry(body: mujoco.MjsBody, pos: ArrayLike, turn: ArrayLike) -> None:
    """Turn a body about the origin of its parent, then shift it.

    A frame would do the same, but MuJoCo 3 writes the pose of the body into the scene's text and MuJoCo 4 the frame.

    Args:
        pos: shift [m].
        turn: rotation (wxyz).
    """
    moved = np.empty(3)
    mujoco.mju_rotVecQuat(moved, body.pos, np.asarray(turn, float))
    body.pos, body.quat = moved + np.asarray(pos, float), compound(turn, body.quat)


def servo(scene: mujoco.MjSpec, joint: str, stiffness: float) -> None:
    """Give a joint of the scene a servo: a spring whose rest position events set (`World.drive`).

    Set the damping on the joint. MuJoCo integrates the damping of joints implicitly; the damping of an actuator is
    explicit, and unstable where damping * time step exceeds the inertia.

    Args:
        stiffness: stiffness of the spring [N m/rad, or N/m].
    """
    drive = scene.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    drive.set_to_position(kp=stiffness)


def show(asset: Prop) -> None:
    """Open MuJoCo's viewer with one asset on the table."""
    import mujoco.viewer

    scene = table()
    place(scene, asset, "asset", [0, 0, TABLE_TOP])
    mujoco.viewer.launch(scene.compile())
