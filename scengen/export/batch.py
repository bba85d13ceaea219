"""Scenarios of one layout as worlds that mujoco_warp and MJX step together: one scene, and what differs in each world.

The folder holds `scene.xml`, the first scenario with its robot and without visual geometry, the robot's meshes, and
`worlds.npz` with arrays whose first axis is the world:

* `id`, `split` and `instruction`;
* `model.<field>`: fields of the model that differ between worlds, or that MJCF writes with fewer digits;
* `c.<field>`: such fields that only C MuJoCo reads for each world;
* `state.<field>`: the state at the start.

With them C MuJoCo simulates the bits of a scenario (`opened`). Other simulators compute other contacts and another
solver's forces: there the scenarios are approximate, and no certificate holds.
"""

import hashlib
import io
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..compat import to_plain_mjcf
from ..control.impairment import Impairment
from ..errors import BadConfig, PoolError
from ..pool import PoolRow
from ..sim.embodiment import compose
from ..sim.world import World
from ..validate.playable import scene_errors
from ..work.parallel import UNTRUSTED_LIMITS, apart
from ..work.targets import appearing, check_same
from .mjcf import meshes_of

SCENE = "scene.xml"
"""Name of the file of the scene."""
WORLDS = "worlds.npz"
"""Name of the file of the worlds."""
MESHES = "meshes"
"""Name of the folder of the robot's meshes."""
NOTE = "approximate: certificates hold for C MuJoCo under scengen's controller, not for other simulators"
"""Restriction that every export states."""
PER_WORLD = tuple(
    """qpos0 qpos_spring body_pos body_quat body_ipos body_iquat body_mass body_subtreemass body_inertia body_invweight0
    body_gravcomp jnt_solref jnt_solimp jnt_pos jnt_axis jnt_stiffness jnt_range jnt_actfrcrange jnt_margin dof_solref
    dof_solimp dof_frictionloss dof_armature dof_damping dof_invweight0 geom_solmix geom_solref geom_solimp geom_size
    geom_aabb geom_rbound geom_pos geom_quat geom_friction geom_margin geom_gap geom_rgba site_pos site_quat
    actuator_gainprm actuator_biasprm actuator_forcerange actuator_ctrlrange actuator_gear actuator_acc0""".split()
)
"""Fields of a model of which mujoco_warp 4.0 holds one value for each world."""
C_ONLY = tuple(
    """dof_M0 dof_length site_size cam_pos cam_quat cam_fovy cam_poscom0 cam_pos0 cam_mat0 light_pos light_dir
    light_poscom0 light_pos0 light_dir0 stat.meaninertia stat.meanmass stat.meansize stat.extent stat.center""".split()
)
"""Further fields that may differ: constants of C MuJoCo, of which others hold at most one value, and its cameras."""
BOXES = ("bvh_aabb", "bvh_nodeid")
"""Fields of the trees of boxes in which C MuJoCo looks for contacts. Those of bodies come first, and may differ, too;
those of meshes are far larger."""
OF_FILES = ("paths", "npaths", "nbuffer", "mesh_pathadr")
"""Fields that depend on the names of files."""
STATE = ("qpos", "qvel", "act", "ctrl", "qacc_warmstart", "eq_active", "mocap_pos", "mocap_quat", "userdata")
"""Fields of the state at the start. All others are zero there."""
MAX_LISTED = 4
"""Largest number of layouts that an error lists."""

Fields = Mapping[str, NDArray[Any]]
"""Arrays by the names of fields."""


@dataclass(frozen=True)
class BatchWorld:
    """One scenario as a world."""

    row: PoolRow
    """The scenario."""
    layout: str
    """Hash of everything that the worlds of a batch share."""
    fields: Fields
    """What may differ between worlds, by the names in `PER_WORLD`, `C_ONLY` and `BOXES`."""
    state: Fields
    """The state at the start."""

    @classmethod
    def of(cls, row: PoolRow) -> "BatchWorld":
        """The world of a scenario.

        Raises:
            BadConfig: the scenario has conditions of control, which no simulator but scengen's knows.
            PoolError: MuJoCo does not read the scene.
        """
        with scene_errors(f" of {row.name}"):
            world = World.load(row.scene_xml, row.embodiment)
        if Impairment.of(world.model):
            told = "its control is delayed, noisy, soft, loaded or starts elsewhere, which worlds.npz cannot hold"
            raise BadConfig(f"{row.name} has conditions of control: {told}; give pools without impairments")
        state = {name: np.array(getattr(world.data, name)) for name in STATE}
        return cls(row, *_split_up(world.model), {name: value for name, value in state.items() if value.size})


def _split_up(model: mujoco.MjModel) -> tuple[str, dict[str, NDArray[Any]]]:
    """The hash of what worlds share, and the fields that may differ."""
    shared, free = hashlib.sha256(), dict[str, NDArray[Any]]()
    parts = (("", model), ("opt.", model.opt), ("stat.", model.stat))
    boxes = int(model.body_bvhnum.sum())
    public = ((prefix, part, name) for prefix, part in parts for name in dir(part) if name[0] != "_")
    for name, value in ((f"{prefix}{name}", getattr(part, name)) for prefix, part, name in public):
        if name in BOXES:
            free[name], value = np.array(value[:boxes]), value[boxes:]
        if name in PER_WORLD or name in C_ONLY:
            free[name] = np.array(value)
        elif isinstance(value, (np.ndarray, int, float, bytes)) and name not in OF_FILES:
            content = value if isinstance(value, bytes) else np.asarray(value).tobytes()
            shared.update(f"{name} {np.shape(value)} {len(content)} ".encode() + content)
    return shared.hexdigest(), free


def of_layout(worlds: Iterable[BatchWorld], number: int | None) -> list[BatchWorld]:
    """The worlds of one layout. Layouts are numbered from 1 on, those of most worlds first.

    Args:
        number: number of the layout; None if all worlds have the same one.

    Raises:
        BadConfig: there are several layouts and no number, or there is no such layout.
    """
    found = defaultdict[str, list[BatchWorld]](list)
    for world in worlds:
        found[world.layout].append(world)
    layouts = sorted(found.values(), key=len, reverse=True)
    if number is None and len(layouts) == 1:
        return layouts[0]
    if number is not None and 1 <= number <= len(layouts):
        return layouts[number - 1]
    listed = [
        f"layout={k} ({len(some[0].fields['body_mass'])} bodies, n = {len(some)})" for k, some in enumerate(layouts, 1)
    ]
    more = f" to layout={len(layouts)}" if len(layouts) > MAX_LISTED else ""
    given = f"the scenarios have {len(layouts)} layouts" if number is None else f"layout = {number}"
    raise BadConfig(f"{given}; give {', '.join(listed[:MAX_LISTED])}{more}")


def write_batch(worlds: Sequence[BatchWorld], to: Path) -> bool:
    """Write worlds of one layout into a folder, which appears when it is complete.

    Args:
        to: a folder that is new or empty, or holds these worlds already.

    Returns:
        Whether it was written; it is not if it is there already.

    Raises:
        BadConfig: the folder holds other things, or cannot be written.
        PoolError: the scene as MJCF is another one.
    """
    first = worlds[0]
    files, (layout, base) = apart(_scene, first.row, UNTRUSTED_LIMITS, f"exporting {first.row.name}")
    if layout != first.layout:
        raise PoolError(f"the scene of {first.row.name} changes when MuJoCo writes it as MJCF; see scengen verify")
    files = {**files, WORLDS: _packed(worlds, base)}
    check_same(to, files)
    if (to / WORLDS).exists():
        return False
    with appearing(to, folder=True) as path:
        (path / MESHES).mkdir()
        for name, content in files.items():
            (path / name).write_bytes(content)
    return True


def _packed(worlds: Sequence[BatchWorld], base: Fields) -> bytes:
    """Content of the file of the worlds.

    Args:
        base: fields of the scene in the file.
    """
    arrays: dict[str, NDArray[Any]] = {
        "about": np.array(NOTE),
        "mujoco": np.array(mujoco.__version__),
        **{name: np.array([getattr(one.row, name) for one in worlds]) for name in ("id", "split", "instruction")},
    }
    for name, value in base.items():
        values = np.stack([one.fields[name] for one in worlds])
        if (values != value).any():
            arrays[f"{'model' if name in PER_WORLD else 'c'}.{name}"] = values
    for name in worlds[0].state:
        arrays[f"state.{name}"] = np.stack([one.state[name] for one in worlds])
    packed = io.BytesIO()
    np.savez_compressed(packed, **arrays)  # type: ignore[arg-type]
    return packed.getvalue()


def _scene(row: PoolRow) -> tuple[dict[str, bytes], tuple[str, dict[str, NDArray[Any]]]]:
    """Files of the scene with robot and of its meshes, and what `_split_up` finds in it."""
    with scene_errors(f" of {row.name}"):
        spec = compose(row.scene_xml, row.embodiment)
        spec.compile()
        root = to_plain_mjcf(spec)
        meshes = {f"{MESHES}/{name}": content for name, content in meshes_of(root, MESHES)}
        root.insert(0, ET.Comment(f" {NOTE} "))
        text = ET.tostring(root, encoding="unicode") + "\n"
        return {**meshes, SCENE: text.encode()}, _split_up(mujoco.MjModel.from_xml_string(text, meshes))


def opened(folder: Path | str, number: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """One world of an export in C MuJoCo, at its start: the model and the state of the scenario, bit for bit.

    Args:
        folder: folder of the export.
        number: number of the world, from 0.

    Raises:
        PoolError: the export was made with another version of MuJoCo.
    """
    worlds = np.load(Path(folder, WORLDS))
    if (made := str(worlds["mujoco"])) != mujoco.__version__:
        raise PoolError(f"{folder} was exported with MuJoCo {made}, and this is {mujoco.__version__}; export it again")
    model = mujoco.MjModel.from_xml_path(str(Path(folder, SCENE)))
    data = mujoco.MjData(model)
    for key in worlds.files:
        kind, _, name = key.partition(".")
        if kind in ("model", "c"):
            _set(model.stat if name.startswith("stat.") else model, name.removeprefix("stat."), worlds[key][number])
        elif kind == "state":
            _set(data, name, worlds[key][number])
    return model, data


def _set(part: Any, name: str, value: NDArray[Any]) -> None:
    """Set a field of a model or its data: an array, its first rows, or a number."""
    if np.ndim(value):
        getattr(part, name)[: len(value)] = value
    else:
        setattr(part, name, value)
