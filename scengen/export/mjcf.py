"""Scenes as files that plain MuJoCo can open from any folder."""

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import mujoco

from ..errors import BadConfig
from ..pool import PoolRow
from ..robots import panda
from ..sim import scene_text
from ..sim.embodiment import compose
from ..validate.playable import scene_errors
from ..work.targets import write

NAME_ATTRIBUTES = {"name", "class"}
"""MJCF attributes that define the name of an element or of a class of defaults."""
TEXT_ATTRIBUTES = {"file", "data"}
"""MJCF attributes that hold any text, but no name."""


def export(row: PoolRow, folder: Path, robot: bool) -> None:
    """Write one scenario into `folder`/<id>: scene.xml, and with the robot scene_with_robot.xml.

    The robot's meshes are copied once, into `folder`/meshes. Paths are relative, so that `folder` can be moved. In
    scene_with_robot.xml the key frame "home" has the robot's pose after a reset. Names are those of `without_slashes`;
    apart from them scene.xml is the certified scene.

    Raises:
        BadConfig: the folder cannot be written, or the scene refers to other files.
        PoolError: MuJoCo does not read the scene.
    """
    target = folder / row.id
    scene_text.check(row.scene_xml)
    with scene_errors(f" of {row.name}"):
        spec = compose(row.scene_xml, row.embodiment, visual=True)
        spec.compile()
    written: list[Path] = []
    try:
        for path, content in _files(row, target, spec if robot else None):
            if path.parent == target or not path.exists():  # scenarios share the meshes
                write(path, content)
                written.append(path)
    except BaseException:
        for path in written:
            path.unlink(missing_ok=True)
        for made in (target, target.parent / "meshes"):
            with suppress(OSError):  # there are other files, or nothing
                made.rmdir()
        raise


def _files(row: PoolRow, target: Path, spec: mujoco.MjSpec | None) -> Iterator[tuple[Path, str | bytes]]:
    """Files of a scenario, and their contents: the scenes last.

    Args:
        spec: the scene with its robot; None for the scene alone.
    """
    alone = _written(ET.fromstring(row.scene_xml))
    if spec is not None:
        _add_home(spec)
        root = ET.fromstring(spec.to_xml())
        for name, content in meshes_of(root, "../meshes"):
            yield target.parent / "meshes" / name, content
        yield target / "scene_with_robot.xml", _written(root)
    yield target / "scene.xml", alone


def meshes_of(root: ET.Element, folder: str) -> Iterator[tuple[str, bytes]]:
    """Files of the robot's meshes in a scene, and their contents. The scene then refers to them in `folder`."""
    for mesh in root.iterfind("asset/mesh[@file]"):
        source = panda.mesh_file(mesh.attrib["name"], mesh.attrib["file"])
        name = f"{mesh.attrib['name']}{source.suffix}"
        yield name, source.read_bytes()
        mesh.set("file", f"{folder}/{name}")


def _written(root: ET.Element) -> str:
    without_slashes(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def without_slashes(root: ET.Element) -> None:
    """Rename `plate/rim` to `plate.rim`, and likewise all names with a slash, with all references to them.

    dm_control refuses names with a slash, which in its own models separates the name of an attached model.

    Raises:
        BadConfig: the scene has both names.
    """
    declared = {value for element in root.iter() for key, value in element.items() if key in NAME_ATTRIBUTES}
    spelled = {name: name.replace("/", ".") for name in declared}
    if len(set(spelled.values())) < len(declared):
        twice, _ = Counter(spelled.values()).most_common(1)[0]
        raise BadConfig(f"the scene has two names that become {twice!r} without a slash; rename one of them")
    for element in root.iter():
        for key, value in element.items():
            if key not in TEXT_ATTRIBUTES:
                element.set(key, spelled.get(value, value))


def _add_home(spec: mujoco.MjSpec) -> None:
    """Add a key frame with the robot's pose after a reset, at which MuJoCo's viewer can start as episodes do."""
    model = spec.compile()
    qpos = model.qpos0.copy()
    for names in panda.arms(model):
        fingers = panda.fingers(model, names)
        qpos[[model.joint(name).qposadr[0] for name in names.joints]] = panda.HOME
        qpos[fingers] = panda.start_fingers(model, names)
    spec.add_key(name="home", qpos=qpos.tolist())
    spec.compile()
