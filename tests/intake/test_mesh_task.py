"""An imported mesh in a task of another package: a file of the package, part of ids, certified and verified."""

import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import scengen
from scengen import cli
from scengen.assets.box import Cube
from scengen.assets.mesh_prop import FILE, MeshProp
from scengen.cli.commands.asset import _lines
from scengen.errors import BadConfig
from scengen.params import values

SIZE = (0.04, 0.06, 0.05)
"""Edges of the box that tests import [m]."""


def box(colours=0):
    """A box as an imported body, without the work of an import."""
    mesh = trimesh.creation.box(SIZE).apply_translation((0.0, 0.0, SIZE[2] / 2))
    whole = {"corners": (mesh.vertices,), "vertices": mesh.vertices, "faces": np.asarray(mesh.faces)}
    inertia = 0.2 / 12 * np.diag([0.06**2 + 0.05**2, 0.04**2 + 0.05**2, 0.04**2 + 0.06**2])
    body = {"feet": np.zeros((0, 3)), "com": np.array([0.0, 0.0, 0.025]), "inertia": inertia}
    palette = tuple((k / 8, 0.0, 0.0, 1.0) for k in range(colours))
    painted = np.arange(12) % colours if colours else np.zeros(0, np.int64)
    return MeshProp(mass=0.2, weighed=0.2, palette=palette, painted=painted, **whole, **body)


def stored(folder, prop):
    folder.mkdir(exist_ok=True)
    (folder / FILE).write_text(json.dumps(prop.written()))
    return folder


@dataclass(frozen=True, kw_only=True)
class Held(scengen.Scenario):
    """A family with one imported body and one solid."""

    thing: MeshProp
    cube: Cube = Cube()

    def build(self):
        raise NotImplementedError

    def success(self, world):
        raise NotImplementedError


@pytest.mark.parametrize("colours", [0, 3])
def test_what_is_loaded_is_what_was_written(tmp_path, colours):
    made = box(colours)
    found = MeshProp.load(stored(tmp_path / "box", made))
    assert found == made and hash(found) == hash(made) and found.written() == made.written()
    assert found.size == pytest.approx(SIZE) and found.palette == made.palette
    one, other = (each.spec().compile() for each in (found, made))
    assert (one.mesh_vert == other.mesh_vert).all() and (one.body_inertia == other.body_inertia).all()


def test_a_path_is_relative_to_the_file_that_is_named_and_else_to_the_working_folder(tmp_path, monkeypatch):
    stored(tmp_path / "box", box())
    module = tmp_path / "family.py"
    assert MeshProp.load("box", module) == MeshProp.load("box", str(module)) == box()
    monkeypatch.chdir(tmp_path)
    assert MeshProp.load("box") == box()
    monkeypatch.chdir("/")
    with pytest.raises(BadConfig, match="is not a folder with prop.json; write it with scengen asset mesh=FILE to=box"):
        MeshProp.load("box")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"mass": "heavy"}, "could not convert"),
        ({"mass": 1e9}, "MeshProp.mass"),
        ({"faces": [[0, 1, 99]]}, "refer to vertices that do not exist"),
        ({"palette": [[2, 0, 0, 1]], "painted": [0] * 12}, "colours must lie in"),
        ({"palette": [[1, 0, 0, 1]], "painted": [0] * 11}, "one for each triangle"),
        ({"palette": [[1, 0, 0, 1]], "painted": [1] * 12}, "its palette must hold the colours of its triangles"),
        ({"extra": 1}, "expected com, corners"),
    ],
)
def test_a_damaged_file_is_refused_in_one_line(tmp_path, change, says):
    path = stored(tmp_path / "box", box()) / FILE
    path.write_text(json.dumps({**box().written(), **change}))
    with pytest.raises(BadConfig, match=r"is not the file of a body \(") as found:
        MeshProp.load(tmp_path / "box")
    assert says in str(found.value) and "\n" not in str(found.value)


def test_mass_and_friction_are_parameters_and_the_inertia_follows_the_mass():
    light = replace(box(), mass=0.05, friction=0.3)
    assert values(Held(thing=light))["thing.mass"] == 0.05 and values(Held(thing=light))["thing.friction"] == 0.3
    one, other = (each.spec().compile() for each in (light, box()))
    assert one.body_inertia == pytest.approx(other.body_inertia / 4) and one.geom_friction[0, 0] == 0.3
    assert MeshProp.read(light.written()).spec().compile().body_inertia == pytest.approx(one.body_inertia)


def test_the_id_of_a_scenario_depends_on_the_mesh_and_not_on_its_name():
    other = replace(box(), vertices=box().vertices * 1.01)
    ids = [Held(thing=thing).id for thing in (box(), MeshProp.read(box().written()), other, replace(box(), mass=0.1))]
    assert ids[0] == ids[1] and len(set(ids)) == 3
    assert Held(thing=box()).material == box().material and scengen.load_task("domino_single").nominal.material == ""


@pytest.mark.parametrize(
    ("folder", "line"),
    [
        ("lab/assets/My can-2", 'my_can_2: MeshProp = MeshProp.load("assets/My can-2", __file__)'),
        ("lab/inner/can", 'can: MeshProp = MeshProp.load("can", __file__)'),
        ("apart/class", 'thing: MeshProp = MeshProp.load("apart/class")'),
    ],
)
def test_the_line_to_paste_names_the_folder_as_a_module_of_the_package_does(tmp_path, monkeypatch, folder, line):
    for package in ("lab", "lab/inner"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").touch()
    monkeypatch.chdir(tmp_path)
    assert _lines(Path(folder)) == ("from scengen.assets.mesh_prop import MeshProp", line)


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """A package as `scengen new` writes it, whose block is an imported mesh, by the line that `asset` prints."""
    folder = tmp_path_factory.mktemp("mesh")
    assert cli.run(["new", "task=shove", "package=lab_mesh", f"to={folder}/lab"]) == 0
    trimesh.creation.box(SIZE).export(folder / "box.stl")
    asset = folder / "lab" / "lab_mesh" / "assets" / "block"
    done = called(folder, "asset", f"mesh={folder}/box.stl", f"to={asset}", "mass=0.15")
    assert done.returncode == 0, done.stderr
    first, line = done.stdout.splitlines()[-2:]
    family = folder / "lab" / "lab_mesh" / "shove.py"
    text = re.sub(r"block: Block = .*", line, family.read_text()).replace("import Block, Cube", "import Cube")
    text = text.replace("self.block.width", "float(self.block.size[0])").replace("self.block.height", "0.05")
    family.write_text(text.replace("from scengen.assets.patch", f"{first}\nfrom scengen.assets.patch"))
    conf = folder / "lab" / "lab_mesh" / "conf" / "task" / "shove.yaml"
    conf.write_text(conf.read_text().replace("  cube:\n", "  block:\n    mass:   [uniform, 0.1, 0.2]\n  cube:\n"))
    return folder


def called(folder, *argv):
    """A command in a process of its own, which knows the package by its path."""
    path = os.pathsep.join([str(Path(scengen.__file__).parents[1]), str(folder / "lab")])
    argv = (sys.executable, "-m", "scengen", *argv)
    return subprocess.run(argv, cwd=folder, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True)


def test_a_task_with_a_mesh_is_certified_and_verified_by_others(package):
    search = "hydra.searchpath=[lab/lab_mesh/conf]"
    made = called(package, "generate", search, "task=shove", "n=2", "pool=pool")
    assert made.returncode == 0, made.stdout + made.stderr
    found = called(package, "verify", search, "pool=pool")
    assert found.returncode == 0 and "sound" in found.stdout, found.stdout + found.stderr
    rows = list(scengen.Pool.open(package / "pool").rows())
    assert len({row.params["block.mass"] for row in rows}) == 2, "the mass of the mesh is drawn"
    assert all('mesh name="block/piece_0"' in row.scene_xml and "file=" not in row.scene_xml for row in rows)
    prop = package / "lab" / "lab_mesh" / "assets" / "block" / FILE
    whole = prop.read_text()
    try:
        prop.write_text(whole.replace("0.02", "0.021"))
        other = called(package, "verify", search, "pool=pool")
        assert other.returncode == 1 and "vertex of <mesh block/piece_0>" in other.stdout + other.stderr
    finally:
        prop.write_text(whole)
