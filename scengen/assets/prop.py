"""Props and the table: the base of every asset, the one way to make something solid, and the one way to place it."""

import abc
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from ..geometry import quat
from ..params import check_bounds
from ..robots.suction import LEAKY

TABLE_TOP = 0.8
"""Height of the table top [m]: robosuite's TableArena, `table_offset`."""
TABLE_HALF = 0.4
"""The table reaches from -0.4 to 0.4 m in x and y: robosuite's TableArena, `table_full_size`."""

STIFF = (0.005, 1.0)
"""Contact time constant [s] and damping ratio of every prop. At MuJoCo's default of 0.02 s an 80 mm tile 3 mm
thick falls over by itself, and tiles sink 9 mm into each other in a cascade; at 0.005 s neither happens."""
PRIORITY = 1
"""Contact priority of every prop, above the table's and the robot's 0. Without it MuJoCo takes the larger friction
of a pair and mixes the stiffnesses, so that a prop's own friction and `STIFF` would have no effect on the table."""


BOX = mujoco.mjtGeom.mjGEOM_BOX
Rgba = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class Prop(abc.ABC):
    """Base of every asset: a frozen dataclass of parameters that can fill one body with geoms.

    The origin of the body is where the asset stands on the ground, unless its docstring says otherwise.
    """

    def __post_init__(self) -> None:
        check_bounds(self)

    def spec(self) -> mujoco.MjSpec:
        """A spec with one top-level body called "body"."""
        spec = mujoco.MjSpec()
        spec.compiler.degree = False
        self.fill(spec.worldbody.add_body(name="body"), spec)
        return spec

    @abc.abstractmethod
    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        """Add geoms, joints and parts to `body`; what does not belong to a body, meshes for instance, to `spec`."""


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
    """Add a geom that things collide with: stiff, with a sliding friction of its own against whatever touches it.

    Args:
        size: as MuJoCo counts it, half lengths for boxes [m].
        friction: sliding; torsion and rolling are MuJoCo's defaults.
        mass: of the geom [kg]; else its density [kg/m^3], else MuJoCo's 1000.
        condim: 4, so that a face resists turning on the spot; 3 where that costs time for nothing.
        leaky: no suction cup holds on to it, see `robots.suction.LEAKY`.
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
    """Add a geom that is only looked at: it collides with nothing and weighs nothing."""
    geom = body.add_geom(name=name, type=type, group=1, contype=0, conaffinity=0, mass=0)
    geom.size, geom.pos, geom.quat = np.asarray(size, float), np.asarray(pos, float), np.asarray(quat, float)
    geom.rgba = np.array(rgba, np.float32)
    return geom


def table() -> mujoco.MjSpec:
    """A floor and robosuite's table, with the physics options that every scene carries.

    The options are robosuite's own (models/assets/base.xml: elliptic cone, impratio 20, air, Newton's method) with a
    time step of 2 ms. With impratio 20 conjugate gradients meet their limit of 100 iterations in some steps of most
    tasks, and cost a fifth more over the certificates of 35 tasks (MuJoCo 3.5.0: 241 and 200 CPU seconds). Two families
    have them nevertheless, and say why.
    """
    scene = mujoco.MjSpec()
    option = scene.option
    option.timestep = 0.002
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 20.0
    option.density, option.viscosity = 1.2, 2e-5
    scene.compiler.degree = False
    scene.compiler.autolimits = True
    _look(scene)
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


def _look(scene: mujoco.MjSpec) -> None:
    """Sky, lights and the cameras of robosuite's TableArena, for pictures only."""
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


def place(
    scene: mujoco.MjSpec,
    asset: Prop,
    name: str,
    pos: ArrayLike,
    yaw: float = 0.0,
    free: bool = True,
    turn: ArrayLike | None = None,
) -> None:
    """Put `asset` on the scene as body `name`, its origin at `pos` [m].

    Args:
        yaw: about the vertical [rad].
        turn: orientation instead of that (wxyz).
    """
    orientation = quat("z", yaw) if turn is None else np.asarray(turn).tolist()
    frame = scene.worldbody.add_frame(pos=np.asarray(pos).tolist(), quat=orientation)
    body = frame.attach_body(asset.spec().body("body"), f"{name}/", "")
    body.name = name
    if free:
        body.add_freejoint(name=f"{name}_free")


def servo(scene: mujoco.MjSpec, joint: str, stiffness: float) -> None:
    """Give a joint of the scene a servo that events drive (`World.drive`): a spring whose rest position they set.

    Its damping belongs to the joint, which MuJoCo treats implicitly; that of an actuator is explicit, and unstable
    where damping * time step exceeds the inertia.

    Args:
        stiffness: of the spring [N m/rad, or N/m].
    """
    drive = scene.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    drive.set_to_position(kp=stiffness)


def show(asset: Prop) -> None:
    """Open MuJoCo's viewer on one asset standing on the table."""
    import mujoco.viewer

    scene = table()
    place(scene, asset, "asset", [0, 0, TABLE_TOP])
    mujoco.viewer.launch(scene.compile())
