"""Meshes taken in: what is wrong with them is said in one line, and what is made of them is what it is said to be."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh
from helpers import pictures_are_possible
from manifold3d import Manifold

from scengen import cli
from scengen.assets.turned import FOOT_PROTRUSION, FOOT_RADIUS
from scengen.errors import BadConfig
from scengen.intake.asset import IntakeRequest, drop, make_asset
from scengen.intake.pieces import Pieces, Surface
from scengen.intake.solid import as_mesh, read
from scengen.sim import scene_text

BOX = trimesh.creation.box((0.05, 0.06, 0.07))


def changed(**how):
    """The box, made wrong in one way."""
    mesh = BOX.copy()
    if how.get("open"):
        mesh.update_faces(np.arange(11))
    if how.get("turned"):
        mesh.faces[: how["turned"]] = mesh.faces[: how["turned"], ::-1]
    mesh.apply_scale(how.get("scale", 1.0))
    return mesh


def ell(thick=0.03):
    """An L: a foot of 90 x 40 mm, and an upright at its end, 90 mm high in all."""
    foot = Manifold.cube((0.09, 0.04, thick))
    return as_mesh(foot + Manifold.cube((thick, 0.04, 0.09)))


WRONG = {
    "open": (changed(open=True), "is open: 3 edges have a triangle on one side only; close its holes"),
    "inside_out": (changed(turned=12), "is inside out"),
    "both_ways": (changed(turned=3), "has triangles that face both ways"),
    "millimetres": (
        changed(scale=1000.0),
        "is 70 m long if its numbers are in m; it must be 0.005 to 1 m long; give units=mm",
    ),
    "tiny": (changed(scale=0.01), "is 0.0007 m long if its numbers are in m"),
    "two": (
        trimesh.util.concatenate([BOX, BOX.copy().apply_translation((0.2, 0, 0))]),
        "holds 2 parts (of 210, 210 cm3)",
    ),
    "thin": (trimesh.creation.box((0.05, 0.06, 0.0014)), "is thinner than 1.5 mm under 9"),
    "flat": (trimesh.creation.box((0.05, 0.06, 0.0)), "is flat: it encloses no volume"),
}


@pytest.mark.parametrize("case", WRONG)
@pytest.mark.parametrize("ending", ["stl", "obj", "ply"])
def test_what_is_wrong_with_a_mesh_is_said_in_one_line(tmp_path, capsys, case, ending):
    mesh, says = WRONG[case]
    file = tmp_path / f"{case}.{ending}"
    mesh.export(file)
    assert cli.run(["asset", f"mesh={file}", f"to={tmp_path / 'asset'}"]) == cli.BAD_INPUT
    told = capsys.readouterr().err
    assert says in told and told.count("\n") == 1
    assert not (tmp_path / "asset").exists()


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("none.stl", None, "there is no file"),
        ("mesh.foo", b"x", "no mesh format named '.foo'; known: .glb, .obj, .off, .ply, .stl"),
        ("noise.stl", b"noise", "holds no triangles"),
        ("empty.obj", b"", "holds no triangles"),
        ("points.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "holds no triangles"),
        ("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertices that are not numbers"),
        ("far.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 9\n", "cannot be read as a .obj file"),
        ("noise.glb", b"glTFglTFglTF", "cannot be read as a .glb file"),
        ("noise.ply", b"ply", "cannot be read as a .ply file"),
    ],
)
def test_what_is_no_mesh_is_said_in_one_line(tmp_path, capsys, name, content, says):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    assert cli.run(["asset", f"mesh={tmp_path / name}", f"to={tmp_path / 'asset'}"]) == cli.BAD_INPUT
    told = capsys.readouterr().err
    assert says in told and told.count("\n") == 1


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (["units=mmm"], "no unit named 'mmm' (did you mean 'mm'?)"),
        (["mass=1", "density=500"], "give one of them"),
        (["mass=0"], "mass = 0.0; it must lie in [0.001, 100] kg"),
        (["error=1"], "error = 1.0; it must lie in [0.0002, 0.05] m"),
        (["pieces=0"], "pieces = 0; it must lie in [1, 512]"),
        (["seed=-1"], "seed = -1; it must lie in"),
        (["density=nan"], "density = nan; it must lie in"),
        (["name=cup"], "give one of them"),
    ],
)
def test_settings_that_mean_nothing_are_said_in_one_line(tmp_path, capsys, settings, says):
    BOX.export(tmp_path / "box.stl")
    assert cli.run(["asset", f"mesh={tmp_path / 'box.stl'}", f"to={tmp_path / 'asset'}", *settings]) == cli.BAD_INPUT
    assert says in capsys.readouterr().err


@pytest.fixture
def taken(tmp_path):
    def take(mesh, **settings):
        mesh.export(tmp_path / "mesh.obj", digits=12)
        return make_asset(IntakeRequest(str(tmp_path / "mesh.obj"), **settings))

    return take


def test_a_box_is_one_piece_without_error_and_has_the_inertia_of_a_box(taken):
    """m (b^2 + c^2) / 12; 210 cm^3 of water."""
    box = taken(BOX)
    assert len(box.pieces.hulls) == 1
    assert box.pieces.error.worst < 1e-8 and box.pieces.error.volume == pytest.approx(1.0)
    assert box.prop.mass == pytest.approx(0.21)
    expected = 0.21 / 12 * np.array([0.06**2 + 0.07**2, 0.05**2 + 0.07**2, 0.05**2 + 0.06**2])
    assert np.diag(box.prop.inertia) == pytest.approx(expected)
    assert box.prop.com == pytest.approx([0, 0, 0.035 + FOOT_PROTRUSION])


def test_units_and_mass_are_taken_at_their_word(taken):
    metres, millimetres = taken(BOX, mass=0.5), taken(changed(scale=1000.0), units="mm", mass=0.5)
    assert metres.prop.mass == millimetres.prop.mass == pytest.approx(0.5)
    assert millimetres.prop.inertia == pytest.approx(metres.prop.inertia, rel=1e-6, abs=1e-12)
    assert millimetres.solid.mesh.extents == pytest.approx([0.05, 0.06, 0.07])


def test_an_l_becomes_a_few_pieces_and_its_hull_fills_the_notch(taken):
    """Two boxes, 30 x 40 x 90 and 60 x 40 x 30 mm, and the parallel axis theorem; half-way up the slope of the notch,
    60 mm wide and high, both walls are 30 mm away."""
    found = taken(ell(), error=0.001, density=500.0)
    assert 2 <= len(found.pieces.hulls) <= 4 and found.pieces.error.worst <= 0.001
    assert found.hull.error.outward == pytest.approx(0.03, rel=0.02)
    masses, sizes = 500.0 * np.array([108e-6, 72e-6]), np.array([[0.03, 0.04, 0.09], [0.06, 0.04, 0.03]])
    centres = np.array([[0.015, 0.02, 0.045], [0.06, 0.02, 0.015]])
    com = masses @ centres / masses.sum()
    about_y = masses @ ((sizes[:, 0] ** 2 + sizes[:, 2] ** 2) / 12 + ((centres - com)[:, [0, 2]] ** 2).sum(axis=1))
    assert found.prop.mass == pytest.approx(masses.sum())
    assert found.prop.inertia[1, 1] == pytest.approx(about_y, rel=1e-6)
    assert found.prop.com == pytest.approx([0, 0, com[2] + FOOT_PROTRUSION], abs=1e-5)


def test_a_ring_keeps_its_hole(taken):
    """A ball that fits through it touches nothing; in the convex hull it would."""
    ring = taken(trimesh.creation.torus(0.05, 0.012, 48, 24), error=0.002, pieces=128)
    assert ring.pieces.error.worst <= 0.002
    assert touches(ring.prop, (0, 0, 0.012), 0.035) == 0
    assert touches(replace(ring.prop, corners=tuple(ring.hull.corners)), (0.003, 0.002, 0.004), 0.035) > 0


def touches(prop, spot, radius):
    """How many contacts a ball has with a prop."""
    spec = prop.spec()
    ball = spec.worldbody.add_body(pos=spot)
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0])
    ball.add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data.ncon


@pytest.mark.parametrize(("grown", "outward", "inward"), [(0.005, 0.005, 0.0), (-0.005, 0.0, 0.005)])
def test_errors_are_measured_both_ways(tmp_path, grown, outward, inward):
    """A box whose piece is 5 mm too long, or too short, at one end."""
    BOX.export(tmp_path / "box.stl")
    solid = read(str(tmp_path / "box.stl"))
    piece = Manifold.cube((0.05, 0.06, 0.07 + grown)).translate((-0.025, -0.03, -0.035))
    error = Pieces.of([piece], Surface(solid.manifold, 0), 0).error
    assert (error.outward, error.inward) == pytest.approx((outward, inward), abs=3e-5)
    assert error.volume == pytest.approx((0.07 + grown) / 0.07, rel=1e-6)


def test_the_error_of_a_hull_is_the_depth_of_what_it_fills(tmp_path):
    """A box with a slot 10 mm wide and 40 mm deep: nothing in the slot is farther from a wall than 5 mm."""
    slotted = Manifold.cube((0.05, 0.06, 0.07)) - Manifold.cube((0.01, 0.06, 0.04)).translate((0.02, 0, 0.03))
    as_mesh(slotted).export(tmp_path / "slotted.stl")
    solid = read(str(tmp_path / "slotted.stl"))
    error = Pieces.of([solid.manifold.hull()], Surface(solid.manifold, 0), 0).error
    assert error.outward == pytest.approx(0.005, rel=0.02)
    assert error.inward == 0.0 and error.volume == pytest.approx(210 / 186, rel=1e-6)


def test_what_stands_flat_comes_to_rest_and_what_is_round_below_does_not(taken):
    assert taken(BOX).rest.rests
    bowl = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    tumbler = as_mesh(Manifold.hull_points(bowl.vertices[bowl.vertices[:, 2] < 0.01]))
    tumbler.apply_transform(trimesh.transformations.rotation_matrix(0.6, (1, 0, 0)))
    rest = taken(tumbler, error=0.005).rest
    assert not rest.rests and rest.speed > 0.001


@pytest.mark.parametrize("thick", [0.025, 0.03])
def test_an_l_stands_still_on_its_feet_and_would_creep_without(taken, thick):
    found = taken(ell(thick), error=0.001)
    assert found.rest.rests and found.rest.creep < 1e-6 and len(found.prop.feet) == 4
    assert found.prop.feet[:, 2] == pytest.approx(FOOT_RADIUS, abs=1e-6)
    assert not drop(replace(found.prop, feet=np.zeros((0, 3)))).rests


def test_what_would_fall_over_gets_no_feet(taken):
    tall = trimesh.creation.box((0.02, 0.02, 0.12))
    tall.apply_transform(trimesh.transformations.rotation_matrix(0.3, (1, 0, 0)))
    found = taken(tall)
    assert not len(found.prop.feet) and found.rest.turn > 1.0


@pytest.mark.slow
def test_the_same_input_gives_the_same_bytes(taken):
    ring = trimesh.creation.torus(0.05, 0.012, 32, 16)
    first, second = (taken(ring, error=0.003) for _ in range(2))
    assert first.xml == second.xml
    assert json.dumps(first.figures()) == json.dumps(second.figures())


def test_an_asset_stands_alone(taken):
    found = taken(ell(), error=0.001)
    scene_text.check(found.xml)
    model = mujoco.MjModel.from_xml_string(found.xml)
    assert model.body("body").mass[0] == pytest.approx(found.prop.mass, rel=1e-5)
    assert np.sort(model.body("body").inertia) == pytest.approx(np.linalg.eigvalsh(found.prop.inertia), rel=1e-4)
    assert model.ngeom == len(found.pieces.hulls) + len(found.prop.feet) + 1


class TestCommand:
    @pytest.fixture
    def run(self, tmp_path, capsys):
        BOX.export(tmp_path / "mesh.stl")

        def command(*settings):
            status = cli.run(["asset", f"mesh={tmp_path / 'mesh.stl'}", f"to={tmp_path / 'asset'}", *settings])
            return status, capsys.readouterr().out

        return command

    def test_it_writes_an_asset_and_says_so_the_second_time(self, run, tmp_path):
        status, said = run("mass=0.1")
        assert status == cli.OK and "1 convex piece: " in said and "nothing was computed" not in said
        files = {p.name: p.read_bytes() for p in (tmp_path / "asset").iterdir()}
        assert set(files) == {"asset.xml", "asset.json"} | ({"preview.png"} if pictures_are_possible() else set())
        status, again = run("mass=0.1")
        assert status == cli.OK and "nothing was computed" in again
        assert again.splitlines()[1:] == said.splitlines()[1:]
        assert files == {p.name: p.read_bytes() for p in (tmp_path / "asset").iterdir()}

    def test_other_settings_another_file_and_a_damaged_asset_are_computed_anew(self, run, tmp_path):
        run()
        assert "nothing was computed" not in run("density=500")[1]
        (tmp_path / "asset" / "asset.xml").write_text("<mujoco/>")
        assert "nothing was computed" not in run("density=500")[1]
        changed(scale=0.9).export(tmp_path / "mesh.stl")
        assert "nothing was computed" not in run("density=500")[1]
        (tmp_path / "asset" / "asset.json").write_text("[]")
        assert "nothing was computed" not in run("density=500")[1]
        assert "nothing was computed" in run("density=500")[1]

    def test_an_error_that_is_missed_is_status_1(self, run, tmp_path):
        ell().export(tmp_path / "mesh.stl")
        status, said = run("pieces=1", "error=0.001")
        assert status == 1 and "1 convex piece: " in said and "MISSED: the error of 1 mm" in said


def test_an_unknown_unit_is_no_matter_of_the_command_line_alone():
    with pytest.raises(BadConfig, match="give one of them"):
        make_asset(IntakeRequest("nowhere.stl", mass=1.0, density=1.0))
