"""What each kind of perturbation does to lights and cameras of a scene, to pictures, readings and instructions.

An effect draws its values once for an episode, from a strength whose unit is the kind's own. It then changes the
compiled scene, of which only pictures see lights, colours and cameras, or each picture, each reading, or the text.
"""

import io
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter

from ..assets.prop import TABLE_TOP
from ..geometry import Vec3, rotation
from ..look.looks import LOOKS, ROOM
from ..look.room import TABLE, WALL_NAMES
from ..samplers import conditions
from .distractors import put
from .language import CLAUSES, WORDINGS, Words, extended, worded
from .things import EDGE, paint, print_on

Values = Mapping[str, float | Sequence[float]]
"""Drawn values of a perturbation in an episode, by name, as they are stored."""
Picture = NDArray[np.uint8]
"""Shape (height, width, 3), RGB."""
Reading = NDArray[np.float64]
"""Reading of a stream."""
Random = np.random.Generator

PICTURES = "pictures"
"""What a kind changes: pictures of cameras."""
PROPRIOCEPTION = "proprioception"
"""What a kind changes: the streams of the robot's own pose."""
WRENCH = "wrench"
"""What a kind changes: force and torque of the wrist."""
OBJECTS = "object-state"
"""What a kind changes: poses, velocities and sizes of bodies."""
LANGUAGE = "the instruction"
"""What a kind changes: the text that a policy is given."""
CONTROL = "control"
"""What a kind changes: the conditions of control, see `scengen.samplers.conditions`. It is not neutral."""
FIXED = "fixed cameras"
"""Cameras that a kind changes: those that stand still."""
WRIST = "wrist cameras"
"""Cameras that a kind changes: those that move with a hand."""
EVERY = "all cameras"
"""Cameras that a kind changes: all."""
TABLE_CENTRE: Vec3 = np.array([0.0, 0.0, TABLE_TOP])
"""Place at which the key light aims [m]."""
ROOM_ONLY = (ROOM.name,)
"""Looks that have walls and textures."""
EYE = "eye_in_hand"
"""End of the names of the cameras on wrists."""


@dataclass(frozen=True)
class Effect:
    """What a kind does. A part that it leaves out does nothing."""

    draw: Callable[[float, Random], Values]
    """Draws the values of an episode, given a strength."""
    reads: str = PICTURES
    """What it changes."""
    cameras: str = EVERY
    """Cameras in which it shows."""
    on_model: Callable[[mujoco.MjModel, Values], None] = lambda model, values: None
    """Changes the compiled scene."""
    on_things: Callable[[mujoco.MjModel, Values, Collection[str]], None] | None = None
    """Changes things in the compiled scene, given patterns of the names of bodies whose look carries no meaning."""
    on_picture: Callable[[Picture, Values, Random], Picture] | None = None
    """Changes a picture; the random numbers belong to the picture's time and camera."""
    on_reading: Callable[[Sequence[str], Reading, Values, Random], Reading] | None = None
    """Changes a reading, given the full names of its entries; the random numbers belong to its time and stream."""
    on_text: Callable[[str, Values, Words], str] | None = None
    """Changes the instruction."""
    varies: bool = True
    """Whether scenarios differ in what is drawn. The level alone decides else."""
    is_passing: bool = False
    """Whether it changes some pictures of an episode only, so that what it hides is seen again in the next ones."""
    looks: Collection[str] = tuple(LOOKS)
    """Names of the looks that show it."""
    is_added: bool = False
    """Whether it shows spare geoms or materials, with which the scene must be compiled
    (`scengen.perturb.distractors.with_spares`)."""
    is_late: bool = False
    """Whether pictures arrive `seconds` late."""


def number_in(values: Values, name: str) -> float:
    """A drawn value that is one number."""
    return float(np.asarray(values[name]))


def _sign(rng: Random) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0


def _way(rng: Random) -> NDArray[np.float64]:
    """A random unit vector."""
    way = rng.normal(size=3)
    return way / np.linalg.norm(way)


# --- lights -------------------------------------------------------------------------------------


def _key(model: mujoco.MjModel) -> int:
    """Number of the light that casts shadows."""
    return int(np.flatnonzero(model.light_castshadow)[0])


def _turn_light(model: mujoco.MjModel, values: Values) -> None:
    key = _key(model)
    turn = rotation(np.asarray(values["axis"], float) * float(np.radians(values["angle"])))  # type: ignore[arg-type]
    model.light_dir[key] = turn @ model.light_dir[key]
    away = np.linalg.norm(model.light_pos[key] - TABLE_CENTRE)
    model.light_pos[key] = TABLE_CENTRE - away * model.light_dir[key] / np.linalg.norm(model.light_dir[key])


def _flat_axis(strength: float, rng: Random) -> Values:
    turn = rng.uniform(0.0, 2.0 * np.pi)
    return {"angle": strength, "axis": [float(np.cos(turn)), float(np.sin(turn)), 0.0]}


def _scale(*names: str) -> Callable[[mujoco.MjModel, Values], None]:
    """Scale colours of all lights, or of the headlight, by a factor for each channel."""

    def change(model: mujoco.MjModel, values: Values) -> None:
        factor = np.asarray(values["factor"], float)
        for name in names:
            if name.startswith("head_"):
                part = name.removeprefix("head_")
                setattr(model.vis.headlight, part, np.clip(getattr(model.vis.headlight, part) * factor, 0.0, 1.0))
            else:
                array = getattr(model, f"light_{name}")
                array[:] = np.clip(array * factor, 0.0, 2.0)

    return change


def _brighter(strength: float, rng: Random) -> Values:
    """Powers of two, darker or brighter."""
    return {"factor": [float(2.0 ** (_sign(rng) * strength))] * 3}


def _tint(strength: float, rng: Random) -> Values:
    """Warmer or colder light: more red and less blue, or the other way."""
    shift = _sign(rng) * strength
    return {"factor": [1.0 + shift, 1.0, 1.0 - shift]}


def _contrast(model: mujoco.MjModel, values: Values) -> None:
    """Move light from everywhere, that of fills included, to the light that casts shadows, or back."""
    shift = number_in(values, "shift")
    model.light_diffuse[~model.light_castshadow.astype(bool)] *= 1.0 - shift
    model.vis.headlight.ambient[:] = np.clip(model.vis.headlight.ambient * (1.0 - shift), 0.0, 1.0)
    model.vis.headlight.diffuse[:] = np.clip(model.vis.headlight.diffuse * (1.0 - shift), 0.0, 1.0)
    model.light_diffuse[_key(model)] *= 1.0 + 0.6 * shift


# --- surfaces -----------------------------------------------------------------------------------


def _colour(strength: float, rng: Random) -> Values:
    return {"share": strength, "colour": rng.uniform(0.1, 0.9, 3).tolist()}


def _blended(rgb: NDArray[np.float64], values: Values) -> NDArray[np.float64]:
    share = number_in(values, "share")
    return (1.0 - share) * rgb + share * np.asarray(values["colour"], float)


def _paint(*names: str) -> Callable[[mujoco.MjModel, Values], None]:
    """Change the colours of those of some geoms that the scene has; their textures stay."""

    def change(model: mujoco.MjModel, values: Values) -> None:
        for geom in (model.geom(number) for number in range(model.ngeom)):
            if geom.name in names:
                geom.rgba[:3] = _blended(np.asarray(geom.rgba[:3], float), values)

    return change


def _pattern(strength: float, rng: Random) -> Values:
    colour, cells = rng.uniform(0.2, 1.0, 3).tolist(), int(rng.integers(2, 9))
    return {"share": strength, "colour": colour, "cells": cells, "kind": int(rng.integers(len(PATTERNS)))}


def _print_table(model: mujoco.MjModel, values: Values) -> None:
    """Blend the texture of the table with a pattern."""
    material = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_MATERIAL, TABLE.name)
    if material < 0:
        return
    texture = int(model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB])
    shape = (model.tex_height[texture], model.tex_width[texture], model.tex_nchannel[texture])
    start = model.tex_adr[texture]
    data = model.tex_data[start : start + int(np.prod(shape))]
    cells, kind = (round(number_in(values, name)) for name in ("cells", "kind"))
    shade = PATTERNS[kind](*(np.indices(shape[:2]) * cells / shape[0]))[..., None]
    pattern = 255.0 * (shade + (1.0 - shade) * np.asarray(values["colour"], float))
    share = number_in(values, "share")
    data[:] = ((1.0 - share) * data.reshape(shape) + share * pattern).round().astype(np.uint8).ravel()


PATTERNS: Sequence[Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]] = (
    lambda rows, columns: (np.floor(rows) + np.floor(columns)) % 2.0,
    lambda rows, columns: np.floor(2.0 * rows) % 2.0,
    lambda rows, columns: (np.hypot(rows % 1.0 - 0.5, columns % 1.0 - 0.5) > 0.3).astype(float),
)
"""Checks, stripes and dots on a tile: 0 or 1 at places that are given in cells."""


def _keyed(strength: float, rng: Random) -> Values:
    return {"share": strength, "key": int(rng.integers(2**31))}


def _paint_things(model: mujoco.MjModel, values: Values, bodies: Collection[str]) -> None:
    paint(model, number_in(values, "share"), round(number_in(values, "key")), bodies)


def _patterned(strength: float, rng: Random) -> Values:
    return {**_keyed(strength, rng), "cells": int(rng.integers(2, 5)), "kind": int(rng.integers(len(PATTERNS)))}


def _print_things(model: mujoco.MjModel, values: Values, bodies: Collection[str]) -> None:
    key, cells, kind = (round(number_in(values, name)) for name in ("key", "cells", "kind"))
    shade = PATTERNS[kind](*(np.indices((EDGE, EDGE)) * cells / EDGE))
    print_on(model, number_in(values, "share"), key, shade, bodies)


def _show_things(model: mujoco.MjModel, values: Values) -> None:
    number, key = (round(number_in(values, name)) for name in ("number", "key"))
    put(model, number, key)


# --- cameras ------------------------------------------------------------------------------------


def is_among(camera: str, which: str) -> bool:
    """Whether a camera, given robosuite's name, is one of `FIXED`, `WRIST` or `EVERY`."""
    return which == EVERY or camera.endswith(EYE) == (which == WRIST)


def _move_cameras(which: str) -> Callable[[mujoco.MjModel, Values], None]:
    def change(model: mujoco.MjModel, values: Values) -> None:
        for number in (n for n in range(model.ncam) if is_among(model.camera(n).name, which)):
            if "way" in values:
                model.cam_pos[number] += np.asarray(values["way"], float)
            if "turn" in values:
                quat = np.empty(4)
                mujoco.mju_mat2Quat(quat, rotation(np.radians(np.asarray(values["turn"], float))).ravel())
                mujoco.mju_mulQuat(model.cam_quat[number], model.cam_quat[number].copy(), quat)
            if "fovy" in values:
                model.cam_fovy[number] *= number_in(values, "fovy")

    return change


def _shift(strength: float, rng: Random) -> Values:
    return {"way": (strength * _way(rng)).tolist()}


def _turn(strength: float, rng: Random) -> Values:
    return {"turn": (strength * _way(rng)).tolist()}


def _zoom(strength: float, rng: Random) -> Values:
    return {"fovy": float((1.0 + strength) ** _sign(rng))}


def _knock(strength: float, rng: Random) -> Values:
    """A millimetre for each degree."""
    return {"way": (0.001 * strength * _way(rng)).tolist(), "turn": (strength * _way(rng)).tolist()}


# --- pictures -----------------------------------------------------------------------------------


def _grain(picture: Picture, values: Values, rng: Random) -> Picture:
    noisy = picture + rng.normal(0.0, number_in(values, "sigma"), picture.shape)
    return np.clip(noisy.round(), 0, 255).astype(np.uint8)


def _blur(picture: Picture, values: Values, rng: Random) -> Picture:
    sigma = number_in(values, "sigma") * picture.shape[0] / 256
    return np.clip(gaussian_filter(picture.astype(float), (sigma, sigma, 0.0)).round(), 0, 255).astype(np.uint8)


def _compress(picture: Picture, values: Values, rng: Random) -> Picture:
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "jpeg", quality=max(1, round(100.0 - number_in(values, "loss"))))
    return np.asarray(Image.open(buffer))


def _expose(picture: Picture, values: Values, rng: Random) -> Picture:
    return np.clip((picture * number_in(values, "factor")).round(), 0, 255).astype(np.uint8)


def _cover(picture: Picture, values: Values, rng: Random) -> Picture:
    """A dark square, which stays in its place during an episode."""
    height, width, _ = picture.shape
    edge = number_in(values, "edge")
    at = np.asarray(values["at"], float) * (1.0 - edge)
    rows, columns = (slice(round(a * n), round((a + edge) * n)) for a, n in zip(at, (height, width), strict=True))
    covered = picture.copy()
    covered[rows, columns] = 24
    return covered


def _drop(picture: Picture, values: Values, rng: Random) -> Picture:
    return np.zeros_like(picture) if rng.random() < number_in(values, "share") else picture


def _value(name: str) -> Callable[[float, Random], Values]:
    return lambda strength, rng: {name: strength}


# --- readings -----------------------------------------------------------------------------------

RAD_PER_M = 1.0
"""Error of an angle for a metre of error of a place [rad/m]: 1 mm goes with 0.06 deg."""
FINGER_SHARE = 0.2
"""Error of the fingers' places as a share of that of the hand."""
TORQUE_PER_FORCE = 0.05
"""Error of a torque for a newton of error of a force [m]."""


def _scale_of(entry: str) -> float:
    """Scale of the error of an entry of a stream, for a strength in its unit."""
    part, _, axis = entry.rpartition(".")
    if part.endswith("quat"):
        return RAD_PER_M / 2.0  # entries of a quaternion are those of half the angle
    if part.endswith("gripper_qpos"):
        return FINGER_SHARE
    return TORQUE_PER_FORCE if axis.startswith("torque") else 1.0


def _noise(entries: Sequence[str], reading: Reading, values: Values, rng: Random) -> Reading:
    return _erring(entries, reading, rng.normal(0.0, number_in(values, "sigma"), reading.shape))


def _bias(entries: Sequence[str], reading: Reading, values: Values, rng: Random) -> Reading:
    """The same error throughout an episode: an entry's sign follows from its place and the values alone."""
    signs = np.random.default_rng(int(np.asarray(values["key"]))).choice([-1.0, 1.0], reading.shape)
    return _erring(entries, reading, signs * number_in(values, "bias"))


def _erring(entries: Sequence[str], reading: Reading, error: Reading) -> Reading:
    found = reading + np.array([_scale_of(entry) for entry in entries]).reshape(reading.shape) * error
    quats = [number for number, entry in enumerate(entries) if entry.rpartition(".")[0].endswith("quat")]
    for start in quats[::4]:
        part = found[start : start + 4]
        part /= max(float(np.linalg.norm(part)), 1e-9)
    return found


# --- instructions -------------------------------------------------------------------------------


def _wording(kind: str) -> Effect:
    """Another text in place of the instruction."""

    def change(text: str, values: Values, words: Words) -> str:
        return worded(kind, round(number_in(values, "text")), words)

    return Effect(_value("text"), LANGUAGE, on_text=change, varies=False)


def _clauses(kind: str) -> Effect:
    """Sentences around the instruction."""

    def change(text: str, values: Values, words: Words) -> str:
        number, key = (round(number_in(values, name)) for name in ("clauses", "key"))
        return extended(kind, number, key, text)

    return Effect(
        lambda strength, rng: {"clauses": strength, "key": int(rng.integers(2**31))}, LANGUAGE, on_text=change
    )


EFFECTS: Mapping[str, Effect] = {
    "thing_texture": Effect(_patterned, on_things=_print_things, looks=ROOM_ONLY, is_added=True),
    "thing_colour": Effect(_keyed, on_things=_paint_things),
    "light_direction": Effect(_flat_axis, on_model=_turn_light),
    "light_intensity": Effect(_brighter, on_model=_scale("diffuse", "head_ambient", "head_diffuse")),
    "light_colour": Effect(_tint, on_model=_scale("diffuse", "head_ambient", "head_diffuse")),
    "ambient": Effect(_brighter, on_model=_scale("head_ambient")),
    "shadow": Effect(_value("shift"), on_model=_contrast, varies=False),
    "table_colour": Effect(_colour, on_model=_paint("table_top")),
    "room_colour": Effect(_colour, cameras=FIXED, on_model=_paint("floor", *WALL_NAMES)),
    "table_texture": Effect(_pattern, on_model=_print_table, looks=ROOM_ONLY),
    "distractors": Effect(
        lambda strength, rng: {"number": strength, "key": int(rng.integers(2**31))},
        cameras=FIXED,
        on_model=_show_things,
        is_added=True,
    ),
    "camera_position": Effect(_shift, cameras=FIXED, on_model=_move_cameras(FIXED)),
    "camera_angle": Effect(_turn, cameras=FIXED, on_model=_move_cameras(FIXED)),
    "camera_fov": Effect(_zoom, on_model=_move_cameras(EVERY)),
    "wrist_camera": Effect(_knock, cameras=WRIST, on_model=_move_cameras(WRIST)),
    "noise": Effect(_value("sigma"), on_picture=_grain, varies=False),
    "blur": Effect(_value("sigma"), on_picture=_blur, varies=False),
    "compression": Effect(_value("loss"), on_picture=_compress, varies=False),
    "exposure": Effect(lambda strength, rng: {"factor": float(2.0 ** (_sign(rng) * strength))}, on_picture=_expose),
    "patch": Effect(lambda strength, rng: {"edge": strength, "at": rng.random(2).tolist()}, on_picture=_cover),
    "dropped": Effect(_value("share"), on_picture=_drop, varies=False, is_passing=True),
    "late": Effect(_value("seconds"), is_late=True, varies=False, is_passing=True),
    "proprioception_noise": Effect(_value("sigma"), PROPRIOCEPTION, on_reading=_noise, varies=False),
    "proprioception_bias": Effect(
        lambda strength, rng: {"bias": strength, "key": int(rng.integers(2**31))}, PROPRIOCEPTION, on_reading=_bias
    ),
    "wrench_noise": Effect(_value("sigma"), WRENCH, on_reading=_noise, varies=False),
    "object_noise": Effect(_value("sigma"), OBJECTS, on_reading=_noise, varies=False),
    **{kind: _wording(kind) for kind in WORDINGS},
    **{kind: _clauses(kind) for kind in CLAUSES},
    **{kind: Effect(lambda strength, rng: {}, CONTROL) for kind in conditions.KINDS},
}
"""What each kind does, by its name. `conf/perturbations` has a file for each, with its strengths."""
