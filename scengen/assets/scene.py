"""The empty table that every scene starts from, and the one way to put an asset on it."""

import math
from typing import Protocol

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

TABLE_TOP = 0.8
"""Height of the table top [m]: robosuite's TableArena, `table_offset`."""
TABLE_HALF = 0.4
"""The table reaches from -0.4 to 0.4 m in x and y: robosuite's TableArena, `table_full_size`."""
UP: NDArray[np.float64] = np.array([0.0, 0.0, 1.0])

STIFF = (0.005, 1.0)
"""Contact time constant [s] and damping ratio of every prop. At MuJoCo's default of 0.02 s an 80 mm tile 3 mm
thick falls over by itself, and tiles sink 9 mm into each other in a cascade; at 0.005 s neither happens."""
PRIORITY = 1
"""Contact priority of every prop, above the table's and the robot's 0. Without it MuJoCo takes the larger friction
of a pair and mixes the stiffnesses, so that a prop's own friction and `STIFF` would have no effect on the table."""


class Asset(Protocol):
    """Anything that can be placed: it builds a spec with one top-level body called "body"."""

    def spec(self) -> mujoco.MjSpec: ...


def table() -> mujoco.MjSpec:
    """A floor and robosuite's table, with the physics options that every scene carries.

    The options are robosuite's own (models/assets/base.xml: elliptic cone, impratio 20, air) with a time step of
    2 ms and the conjugate-gradient solver, which costs a third of Newton on toppling piles at the same grasp slip.
    """
    scene = mujoco.MjSpec()
    option = scene.option
    option.timestep = 0.002
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.solver = mujoco.mjtSolver.mjSOL_CG
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
    sky.rgb1, sky.rgb2 = [0.9, 0.9, 1.0], [0.45, 0.52, 0.62]
    visual = getattr(scene.visual, "global")
    visual.offwidth, visual.offheight = 1280, 960
    scene.visual.headlight.ambient = [0.35, 0.35, 0.35]
    scene.visual.map.znear = 0.001
    world = scene.worldbody
    world.add_light(pos=[0.6, -0.8, 2.4], dir=[-0.3, 0.4, -1.2], diffuse=[0.6, 0.6, 0.6], castshadow=True)
    for name, pos, quat in CAMERAS:
        world.add_camera(name=name, pos=pos, quat=quat)


CAMERAS = (
    ("frontview", (1.6, 0, 1.45), (0.56, 0.43, 0.43, 0.56)),
    ("birdview", (-0.2, 0, 3.0), (0.7071, 0, 0, 0.7071)),
    ("agentview", (0.5, 0, 1.35), (0.653, 0.271, 0.271, 0.653)),
    ("sideview", (-0.056518, 1.276122, 1.487957), (0.009905, 0.006878, 0.591223, 0.806418)),
)
"""Name, position [m] and orientation (wxyz) of robosuite's TableArena cameras."""


def place(scene: mujoco.MjSpec, asset: Asset, name: str, pos: ArrayLike, yaw: float = 0.0, free: bool = True) -> None:
    """Put `asset` on the scene as body `name` at `pos` [m], turned by `yaw` [rad] about the vertical."""
    frame = scene.worldbody.add_frame(pos=np.asarray(pos), quat=[math.cos(yaw / 2), 0, 0, math.sin(yaw / 2)])
    body = frame.attach_body(asset.spec().body("body"), f"{name}/", "")
    body.name = name
    if free:
        body.add_freejoint(name=f"{name}_free")


def show(asset: Asset) -> None:
    """Open MuJoCo's viewer on one asset standing on the table."""
    import mujoco.viewer

    scene = table()
    place(scene, asset, "asset", [0, 0, TABLE_TOP])
    mujoco.viewer.launch(scene.compile())
