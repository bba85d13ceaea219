"""Every asset as a mesh: closed, as large as it is in the simulation, and listed with its parameters."""

import io
import math

import numpy as np
import pytest
import trimesh

from scengen import cli
from scengen.assets.ball import Ball
from scengen.assets.box import Cube
from scengen.assets.hook import THook
from scengen.assets.kits import kit, kits
from scengen.export.mesh import FORMATS, encode, united
from scengen.intake import solid
from scengen.params import parameters

APART = {"seesaw": 2, "pendulum": 2, "gap_wall": 2, "incline": 3}
"""What consists of parts that touch nowhere, and of how many."""
MARKS = ("patch", "zone")
"""What is only looked at."""


@pytest.mark.parametrize("name", [name for name in kits() if name not in (*APART, *MARKS)])
def test_every_asset_is_a_closed_mesh_that_can_be_taken_in_again(tmp_path, name):
    file, prop = tmp_path / f"{name}.stl", kit(name)
    file.write_bytes(encode(prop, ".stl"))
    assert solid.read(str(file)).manifold.volume() == pytest.approx(united(prop).volume(), rel=1e-4)


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("name", [name for name in kits() if name not in MARKS])
def test_every_asset_is_watertight_in_every_format_for_other_programs(name, ending):
    """trimesh merges vertices at the same place, as other programs do, and then counts the triangles at each edge."""
    mesh = trimesh.load(io.BytesIO(encode(kit(name), ending)), file_type=ending[1:], force="mesh")
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(united(kit(name)).volume(), rel=1e-4)


@pytest.mark.parametrize("name", APART)
def test_what_hangs_in_a_stand_touches_it_nowhere(name):
    assert len(united(kit(name)).decompose()) == APART[name]


@pytest.mark.parametrize("name", MARKS)
def test_there_is_no_mesh_of_a_mark_on_the_table(name, tmp_path, capsys):
    assert cli.run(["asset", f"name={name}", f"to={tmp_path / 'mark.stl'}"]) == 2
    told = capsys.readouterr().err
    assert "a visual mark without collision geometry" in told and told.count("\n") == 1 and not any(tmp_path.iterdir())


def test_volumes_are_those_of_a_textbook():
    assert united(Cube(edge=0.05)).volume() == pytest.approx(0.05**3, rel=2e-3)
    assert united(Ball(radius=0.02)).volume() == pytest.approx(4 / 3 * math.pi * 0.02**3, rel=0.015)
    t = THook()
    assert united(t).volume() == pytest.approx(t.height * t.width * (t.length + 2 * t.tip), rel=3e-3)


@pytest.mark.parametrize("ending", FORMATS)
def test_it_is_the_same_mesh_in_every_format(ending):
    content = trimesh.util.wrap_as_stream(encode(Cube(edge=0.05), ending))
    mesh = trimesh.load(content, file_type=ending[1:], force="mesh")
    expected = (
        [[-0.025, 0, -0.025], [0.025, 0.05, 0.025]] if ending == ".glb" else [[-0.025, -0.025, 0], [0.025, 0.025, 0.05]]
    )
    assert np.allclose(mesh.bounds, expected, atol=2e-5), "y points up in glTF, z elsewhere"


@pytest.mark.parametrize("ending", FORMATS)
def test_what_is_written_stands_upright_when_it_is_taken_in_again(tmp_path, ending):
    """A hook that has another size along each axis."""
    (tmp_path / f"hook{ending}").write_bytes(encode(THook(), ending))
    low, high = np.split(np.array(united(THook()).bounding_box()), 2)
    assert solid.read(str(tmp_path / f"hook{ending}")).mesh.extents == pytest.approx(high - low, abs=3e-6)


def test_all_assets_are_listed_with_their_parameters(capsys):
    assert cli.run(["asset"]) == cli.OK
    listed = capsys.readouterr().out
    for name in kits():
        assert name in listed and all(p.name in listed for p in parameters(kit(name)))


def test_an_asset_is_written_by_name(capsys, tmp_path):
    assert cli.run(["asset", "name=cup", f"to={tmp_path / 'cup.stl'}"]) == cli.OK
    assert trimesh.load(tmp_path / "cup.stl").extents == pytest.approx([0.094, 0.094, 0.095], rel=0.02)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (["name=cpu", "to=x.stl"], "no asset named 'cpu' (did you mean 'cup'?)"),
        (["name=cup", "to=x.txt"], "name a file that ends in .glb, .obj"),
        (["name=cup"], "asset needs to=FILE.stl"),
        (["mesh=cup.stl"], "asset needs to=FOLDER"),
        (["to=x.stl"], "without an asset; give name=ASSET or mesh=FILE"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(capsys, settings, says):
    assert cli.run(["asset", *settings]) == cli.BAD_INPUT
    told = capsys.readouterr().err
    assert says in told and told.count("\n") == 1
