"""Meshes taken in: what is wrong with them is said in one line, and what is made of them is what it is said to be."""

import json
import os
import re
import signal
import struct
import time
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
from scengen.intake import asset
from scengen.intake.asset import IntakeRequest, drop, make_asset
from scengen.intake.crossing import longest_crossing
from scengen.intake.pieces import Pieces, Surface
from scengen.intake.solid import UPRIGHT, as_mesh, read
from scengen.sim import scene_text
from scengen.work.parallel import Limits

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
def test_what_is_wrong_with_a_mesh_is_said_in_one_line(tmp_path, case, ending):
    mesh, says = WRONG[case]
    told = refusal(tmp_path, f"{case}.{ending}", mesh.export(file_type=ending))
    assert says in told and "\n" not in told


def test_the_command_ends_with_that_line_and_writes_nothing(tmp_path, capsys):
    mesh, says = WRONG["two"]
    mesh.export(tmp_path / "two.stl")
    assert cli.run(["asset", f"mesh={tmp_path / 'two.stl'}", f"to={tmp_path / 'asset'}"]) == cli.BAD_INPUT
    told = capsys.readouterr().err
    assert says in told and told.count("\n") == 1
    assert not (tmp_path / "asset").exists()


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("mesh.foo", b"x", "no mesh format named '.foo'; known: .glb, .obj, .off, .ply, .stl"),
        ("noise.stl", b"noise", "holds no triangles"),
        ("empty.obj", b"", "holds no triangles"),
        ("points.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "holds no triangles"),
        ("nan.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertices that are not numbers"),
        ("far.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 9\n", "has corners that are none of its 2 vertices"),
        ("before.obj", b"v 0 0 0\nv 1 0 0\nf -1 -2 -3\n", "has corners that are none of its 2 vertices"),
        ("zero.obj", b"v 0 0 0\nf 0 1 1\n", "cannot be read as a .obj file (line 2: 'f 0 1 1')"),
        ("words.obj", b"v 0 0 0\nv 1,5 0 0\n", "cannot be read as a .obj file (line 2: 'v 1,5 0 0')"),
        ("short.obj", b"v 0 0\n", "cannot be read as a .obj file (line 1: 'v 0 0')"),
        ("short.off", b"OFF\n3 1 0\n0 0 0\n", "cannot be read as a .off file (it ends too early)"),
        ("words.off", b"OFF\n1 1 0\n0 0 zero\n", "cannot be read as a .off file (line 3: '0 0 zero')"),
        ("few.off", b"OFF\n1 1 0\n0 0 0\n4 0 0 0\n", "cannot be read as a .off file (line 4: '4 0 0 0')"),
        ("noise.off", b"noise", "cannot be read as a .off file (line 1: 'noise')"),
        ("type.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\n", "(line 4: 'property quad x')"),
        ("noise.glb", b"glTFglTFglTF", "cannot be read as a .glb file"),
        ("noise.ply", b"ply", "cannot be read as a .ply file"),
    ],
)
def test_what_is_no_mesh_is_said_in_one_line(tmp_path, name, content, says):
    told = refusal(tmp_path, name, content)
    assert says in told and "\n" not in told


def test_a_mesh_that_is_not_there_is_said_in_one_line(tmp_path, capsys):
    assert cli.run(["asset", f"mesh={tmp_path / 'none.stl'}", f"to={tmp_path / 'asset'}"]) == cli.BAD_INPUT
    told = capsys.readouterr().err
    assert "there is no file" in told and told.count("\n") == 1


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (["up=w"], "no axis named 'w'; known: -x, -y, -z, x, y, z"),
        (["up=+z"], "no axis named '+z' (did you mean"),
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_what_stands_flat_comes_to_rest_and_what_is_round_below_does_not(taken):
    assert taken(BOX).rest.rests
    bowl = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    tumbler = as_mesh(Manifold.hull_points(bowl.vertices[bowl.vertices[:, 2] < 0.01]))
    tumbler.apply_transform(trimesh.transformations.rotation_matrix(0.6, (1, 0, 0)))
    rest = taken(tumbler, error=0.005).rest
    assert not rest.rests and rest.speed > 0.001


@pytest.mark.parametrize("thick", [0.025, 0.03])
@pytest.mark.slow
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


@pytest.mark.slow
def test_an_asset_stands_alone(taken):
    found = taken(ell(), error=0.001)
    scene_text.check(found.xml)
    model = mujoco.MjModel.from_xml_string(found.xml)
    assert model.body("body").mass[0] == pytest.approx(found.prop.mass, rel=1e-5)
    assert np.sort(model.body("body").inertia) == pytest.approx(np.linalg.eigvalsh(found.prop.inertia), rel=1e-4)
    assert model.ngeom == len(found.pieces.hulls) + len(found.prop.feet) + 1


# --- polygons, cavities, crossings, axes ------------------------------------------------------


ELL = [(0, 0), (0.06, 0), (0.06, 0.02), (0.02, 0.02), (0.02, 0.06), (0, 0.06)]
"""Outline of an L, counter-clockwise [m]."""
PLUS = [(x / 100, y / 100) for x, y in ((-1, -3), (1, -3), (1, -1), (3, -1), (3, 1), (1, 1))]
PLUS += [(-x, -y) for x, y in PLUS]
"""Outline of a plus, counter-clockwise [m]."""
BOX_CORNERS = [(x, y, z) for z in (0, 0.03) for x, y in ((-0.03, -0.02), (0.03, -0.02), (0.03, 0.02), (-0.03, 0.02))]
BOX_SIDES = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def prism(outline, height=0.03, first=0):
    """Vertices and polygons of a prism whose caps are written from the corner `first`."""
    n = len(outline)
    corners = [(x, y, z) for z in (0, height) for x, y in outline]
    ring = [(i + first) % n for i in range(n)]
    sides = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    return corners, [tuple(reversed(ring)), tuple(n + i for i in ring), *sides]


def written(ending, corners, polygons):
    """A mesh file with polygons."""
    points = ["{} {} {}".format(*corner) for corner in corners]
    if ending == "obj":
        return "\n".join([f"v {p}" for p in points] + ["f " + " ".join(str(i + 1) for i in f) for f in polygons])
    rows = [f"{len(f)} " + " ".join(map(str, f)) for f in polygons]
    if ending == "off":
        return "\n".join(["OFF", f"{len(points)} {len(rows)} 0", *points, *rows])
    axes = [f"property float {axis}" for axis in "xyz"]
    faces = [f"element face {len(rows)}", "property list uchar int vertex_indices", "end_header"]
    return "\n".join(["ply", "format ascii 1.0", f"element vertex {len(points)}", *axes, *faces, *points, *rows])


def binary_ply(corners, polygons, order="<"):
    """A binary PLY file with more properties than are read, before and after those that are."""
    name = "binary_little_endian" if order == "<" else "binary_big_endian"
    head = (
        f"ply\nformat {name} 1.0\ncomment of no interest\nelement vertex {len(corners)}\nproperty uchar red\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(polygons)}\nproperty list uchar int vertex_index\nproperty float area\nend_header\n"
    )
    body = [struct.pack(f"{order}Bddd", 255, *corner) for corner in corners]
    body += [struct.pack(f"{order}B{len(f)}if", len(f), *f, 0.0) for f in polygons]
    return head.encode() + b"".join(body)


def solid_of(tmp_path, name, content, **settings):
    file = tmp_path / name
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read(str(file), **settings)


def refusal(tmp_path, name, content):
    with pytest.raises(BadConfig) as error:
        solid_of(tmp_path, name, content)
    return str(error.value)


@pytest.mark.parametrize("ending", ["obj", "off", "ply"])
@pytest.mark.parametrize("outline", [ELL, PLUS], ids=["ell", "plus"])
def test_a_polygon_that_is_not_convex_is_the_same_from_each_of_its_corners(tmp_path, ending, outline):
    """20 cm2 times 30 mm; fans from other corners than one cover the notches too."""
    made = [
        solid_of(tmp_path, f"prism.{ending}", written(ending, *prism(outline, first=k))) for k in range(len(outline))
    ]
    assert {each.manifold.volume() for each in made} == {made[0].manifold.volume()}
    assert made[0].manifold.volume() == pytest.approx(60e-6)
    assert made[0].manifold.surface_area() == pytest.approx(2 * 20e-4 + 0.24 * 0.03)
    triangles = [each.mesh.triangles for each in made]
    assert all(np.array_equal(each, triangles[0]) for each in triangles)


def test_an_l_of_polygons_is_two_pieces(tmp_path):
    (tmp_path / "ell.obj").write_text(written("obj", *prism(ELL, first=1)))
    found = make_asset(IntakeRequest(str(tmp_path / "ell.obj")))
    assert len(found.pieces.hulls) == 2 and found.pieces.error.worst < 2e-4


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("outline", [ELL, ELL[:1] + ELL[1:2] + ELL[5:]], ids=["mixed", "triangles"])
def test_polygons_of_a_binary_ply_file_are_read(tmp_path, order, outline):
    corners, polygons = prism(outline)
    found = solid_of(tmp_path, "prism.ply", binary_ply(corners, polygons, order))
    assert found.manifold.volume() == pytest.approx(60e-6 if len(outline) == 6 else 54e-6)
    assert "it ends too early" in refusal(tmp_path, "cut.ply", binary_ply(corners, polygons, order)[:-3])


def test_a_polygon_may_have_a_hole_that_a_bridge_joins_to_its_outline(tmp_path):
    """A square frame, 60 mm outside and 20 mm inside, in one polygon: the outline, a bridge, the hole, the bridge."""
    outer = [(0, 0), (0.06, 0), (0.06, 0.06), (0, 0.06)]
    inner = [(0.02, 0.02), (0.02, 0.04), (0.04, 0.04), (0.04, 0.02)]
    corners = [(x, y, z) for z in (0, 0.03) for x, y in (*outer, *inner)]
    cap = (0, 1, 2, 3, 0, 4, 5, 6, 7, 4)
    sides = [(i, (i + 1) % 4, 8 + (i + 1) % 4, 8 + i) for i in range(4)]
    sides += [(4 + i, 4 + (i + 1) % 4, 12 + (i + 1) % 4, 12 + i) for i in range(4)]
    polygons = [cap[::-1], tuple(8 + i for i in cap), *sides]
    found = solid_of(tmp_path, "frame.obj", written("obj", corners, polygons))
    assert found.manifold.volume() == pytest.approx(0.03 * (0.06**2 - 0.02**2))


def test_quadrilaterals_that_are_not_convex_are_cut_inside(tmp_path):
    """An arrow head: 80 x 80 mm, with a notch of 20 mm. One of its two diagonals lies outside."""
    arrow = [(0, 0), (0.04, 0.02), (0.08, 0), (0.04, 0.08)]
    volumes = [
        solid_of(tmp_path, "arrow.obj", written("obj", *prism(arrow, first=k))).manifold.volume() for k in range(4)
    ]
    assert volumes == pytest.approx([0.03 * 0.08 * (0.08 - 0.02) / 2] * 4)


def test_corners_on_a_straight_side_and_corners_twice_change_nothing(tmp_path):
    outline = [*ELL[:1], (0.03, 0), (0.03, 0), *ELL[1:]]
    assert solid_of(tmp_path, "ell.obj", written("obj", *prism(outline))).manifold.volume() == pytest.approx(60e-6)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("tabs.obj", written("obj", BOX_CORNERS, BOX_SIDES).replace(" ", "\t")),
        ("spaces.obj", written("obj", BOX_CORNERS, BOX_SIDES).replace(" ", "   ").replace("\n", "  \r\n  ")),
        ("comments.obj", "# top\n" + written("obj", BOX_CORNERS, BOX_SIDES).replace("\n", " # a side\n")),
        ("continued.obj", written("obj", BOX_CORNERS, BOX_SIDES).replace(" 3 ", " \\\n3 ")),
        ("backwards.obj", written("obj", BOX_CORNERS, [[i - 9 for i in side] for side in BOX_SIDES])),
        ("comments.off", written("off", BOX_CORNERS, BOX_SIDES).replace("\n", " # a row\n\n# more\n")),
        ("one_line.off", written("off", BOX_CORNERS, BOX_SIDES).replace("OFF\n", "OFF ")),
        ("coloured.off", re.sub(r"(?m)^(4 .*)$", r"\1 255 0 0", written("off", BOX_CORNERS, BOX_SIDES))),
    ],
)
def test_what_the_formats_allow_is_read(tmp_path, name, content):
    assert solid_of(tmp_path, name, content).manifold.volume() == pytest.approx(72e-6)


def test_corners_of_a_face_may_name_texture_and_normal(tmp_path):
    text = re.sub(r"(?m)^f (\d+) (\d+) (\d+) (\d+)", r"f \1/1/1 \2//2 \3/7 \4", written("obj", BOX_CORNERS, BOX_SIDES))
    assert "f 4/1/1 3//2 2/7 1" in text
    assert solid_of(tmp_path, "box.obj", text).manifold.volume() == pytest.approx(72e-6)


def test_what_crosses_itself_is_called_so(tmp_path):
    """A prism over a bow tie, whose signed volumes cancel, as polygons and as triangles; a box with a deep pit."""
    bow = [(-0.03, -0.02), (0.03, 0.02), (0.03, -0.02), (-0.03, 0.02)]
    corners, polygons = prism(bow)
    assert "crosses itself: the outline of a polygon does" in refusal(
        tmp_path, "bow.obj", written("obj", corners, polygons)
    )
    fans = [(f[0], f[i], f[i + 1]) for f in polygons for i in (1, 2)]
    assert "crosses itself along 30 mm" in refusal(tmp_path, "bow.obj", written("obj", corners, fans))
    pit = [BOX_SIDES[0], *BOX_SIDES[2:], *[(4 + i, 4 + (i + 1) % 4, 8) for i in range(4)]]
    deep, shallow = ([*BOX_CORNERS, (0, 0, z)] for z in (-0.02, 0.01))
    assert "crosses itself along 79" in refusal(tmp_path, "pit.obj", written("obj", deep, pit))
    assert solid_of(tmp_path, "pit.obj", written("obj", shallow, pit)).manifold.volume() == pytest.approx(56e-6)


def test_two_balls_cross_along_a_circle():
    """Radii 50 mm, centres 60 mm apart: a circle of radius 40 mm."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.05)
    both = trimesh.util.concatenate([ball, ball.copy().apply_translation((0.06, 0, 0))])
    assert longest_crossing(both.vertices, both.faces) == pytest.approx(2 * np.pi * 0.04, rel=0.05)
    assert longest_crossing(ball.vertices, ball.faces) == 0.0


def test_small_folds_of_a_scan_are_no_crossing(tmp_path):
    """A ball with edges of 2 mm: one vertex is pulled over its neighbour, which pokes through the triangles."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.03)
    beside = ball.vertex_neighbors[100][0]
    ball.vertices[100] = 1.01 * (1.5 * ball.vertices[beside] - 0.5 * ball.vertices[100])
    ball.vertices[beside] *= 1.02
    assert 0.001 < longest_crossing(ball.vertices, ball.faces) < 0.003
    ball.export(tmp_path / "ball.stl")
    assert read(str(tmp_path / "ball.stl")).manifold.num_tri() == len(ball.faces)


def inside_out(mesh):
    mesh = mesh.copy()
    mesh.faces = mesh.faces[:, ::-1]
    return mesh


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        ([(0.06, 0, 1), (0.05, 0, -1)], "has a closed cavity of 125 cm3; fill it, or open it to the outside"),
        (
            [(0.06, 0, 1), (0.02, -0.015, -1), (0.02, 0.015, -1)],
            "has 2 closed cavities (of 8, 8 cm3); fill them, or open them to the outside",
        ),
        ([(0.06, 0, 1), (0.05, 0.1, -1)], "holds 2 parts (of 216, 125 cm3), 1 of them inside out; give one part"),
        ([(0.06, 0, -1), (0.05, 0, 1)], "is inside out"),
        ([(0.06, 0, 1), (0.05, 0.1, 1)], "holds 2 parts (of 216, 125 cm3); give one file for each, or join them"),
    ],
)
def test_a_cavity_is_told_from_a_second_part(tmp_path, parts, says):
    """Cubes of an edge, at a place along x, as solids (1) or as cavities (-1)."""
    cubes = []
    for edge, x, sign in parts:
        cube = trimesh.creation.box((edge, edge, edge)).apply_translation((x, 0, 0))
        cubes.append(cube if sign > 0 else inside_out(cube))
    trimesh.util.concatenate(cubes).export(tmp_path / "cubes.stl")
    with pytest.raises(BadConfig) as error:
        read(str(tmp_path / "cubes.stl"))
    assert says in str(error.value)


def test_inertia_does_not_depend_on_where_a_mesh_lies(tmp_path):
    """m (b^2 + c^2) / 12 for 60 x 40 x 30 mm, 2 km from the origin."""
    far = [(x + 1000, y + 2000, z + 5) for x, y, z in BOX_CORNERS]
    (tmp_path / "far.obj").write_text(written("obj", far, BOX_SIDES))
    found = make_asset(IntakeRequest(str(tmp_path / "far.obj"), mass=0.1))
    expected = 0.1 / 12 * np.array([0.04**2 + 0.03**2, 0.06**2 + 0.03**2, 0.06**2 + 0.04**2])
    assert np.diag(found.prop.inertia) == pytest.approx(expected, rel=1e-9)
    assert found.prop.com == pytest.approx([0, 0, 0.015 + FOOT_PROTRUSION], abs=1e-9)


@pytest.mark.parametrize("place", [0.0, 0.1, 0.7])
@pytest.mark.parametrize("size", [(0.005, 0.005, 0.005), (1.0, 0.1, 0.1), (0.05, 0.06, 0.0015)])
def test_sizes_at_a_limit_are_accepted_when_they_are_rounded_to_32_bits(tmp_path, size, place):
    trimesh.creation.box(size).apply_translation((place, 0, place)).export(tmp_path / "box.stl")
    assert read(str(tmp_path / "box.stl")).mesh.extents == pytest.approx(size, abs=2e-7)


@pytest.mark.parametrize("size", [(0.00499, 0.00499, 0.00499), (1.001, 0.1, 0.1), (0.05, 0.06, 0.00149)])
def test_sizes_beyond_a_limit_are_refused(tmp_path, size):
    trimesh.creation.box(size).export(tmp_path / "box.stl")
    with pytest.raises(BadConfig, match="it must be 0.005 to 1 m long|is thinner than 1.5 mm"):
        read(str(tmp_path / "box.stl"))


@pytest.mark.parametrize("up", UPRIGHT)
@pytest.mark.slow
def test_any_axis_can_point_up(tmp_path, up):
    """A pyramid on a base of 50 x 60 mm, 40 mm high: its centre of mass is at a quarter of its height."""
    rot = UPRIGHT[up]
    assert np.linalg.det(rot) == pytest.approx(1.0) and rot @ rot.T == pytest.approx(np.eye(3))
    base = [(x, y, 0.0) for x in (-0.025, 0.025) for y in (-0.03, 0.03)]
    pyramid = as_mesh(Manifold.hull_points(np.array([*base, (0.0, 0.0, 0.04)])))
    turned = np.asarray(pyramid.vertices) @ rot  # as a program with this axis would write it
    assert turned[np.argmax(pyramid.vertices[:, 2])]["xyz".index(up[-1])] == pytest.approx(0.04 * (-1) ** ("-" in up))
    trimesh.Trimesh(turned, pyramid.faces).export(tmp_path / "pyramid.stl")
    found = make_asset(IntakeRequest(str(tmp_path / "pyramid.stl"), up=up))
    assert found.prop.com[2] == pytest.approx(0.01 + FOOT_PROTRUSION, abs=1e-6)
    figures = found.figures()
    opposite = "+" if up.startswith("-") else "-"
    assert (figures["up"], figures["rest"]["side_below"], figures["rest"]["fell"]) == (up, opposite + up[-1], False)


def test_gltf_is_turned_upright_as_it_defines_its_axes(tmp_path):
    """A slab of 120 x 80 mm, 20 mm high along y."""
    trimesh.creation.box((0.12, 0.02, 0.08)).export(tmp_path / "slab.glb")
    assert read(str(tmp_path / "slab.glb")).mesh.extents == pytest.approx([0.12, 0.08, 0.02])
    assert read(str(tmp_path / "slab.glb"), up="z").mesh.extents == pytest.approx([0.12, 0.02, 0.08])
    trimesh.creation.box((0.12, 0.02, 0.08)).export(tmp_path / "slab.obj")
    assert read(str(tmp_path / "slab.obj")).mesh.extents == pytest.approx([0.12, 0.02, 0.08])


# --- a separate process ---------------------------------------------------------------------


def crash(request):
    """A cut that ends with a segmentation fault."""
    os.kill(os.getpid(), signal.SIGSEGV)


def allocate(request):
    """A cut that takes all memory."""
    return np.ones(10**12)


def endless(request):
    """A cut that does not end."""
    time.sleep(60)


@pytest.mark.parametrize(
    ("cut_up", "says"),
    [
        (crash, "the process died: it was ended by SIGSEGV; repair it, or simplify it"),
        (allocate, "the process needs more than 1000 MB"),
        (endless, "the process took longer than 2 s"),
    ],
)
def test_a_cut_that_crashes_or_does_not_end_is_one_line(tmp_path, capfd, monkeypatch, cut_up, says):
    BOX.export(tmp_path / "box.stl")
    monkeypatch.setattr(asset, "_make_asset", cut_up)
    monkeypatch.setattr(asset, "CUTTING_LIMITS", Limits(2.0, 1000))
    assert cli.run(["asset", f"mesh={tmp_path / 'box.stl'}", f"to={tmp_path / 'asset'}"]) == cli.BAD_INPUT
    told = capfd.readouterr().err
    assert says in told and told.count("\n") == 1 and not (tmp_path / "asset").exists()


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
        files = {p.name: p.read_bytes() for p in (tmp_path / "asset").rglob("*.*")}
        expected = {"prop.json", "asset.xml", "asset.json", "asset.urdf", "look_0.obj", "piece_0.obj"}
        assert set(files) == expected | ({"preview.png"} if pictures_are_possible() else set())
        status, again = run("mass=0.1")
        assert status == cli.OK and "nothing was computed" in again
        assert again.splitlines()[1:] == said.splitlines()[1:]
        assert files == {p.name: p.read_bytes() for p in (tmp_path / "asset").rglob("*.*")}

    @pytest.mark.slow
    def test_other_settings_another_file_and_a_damaged_asset_are_computed_anew(self, run, tmp_path):
        run()
        assert "nothing was computed" not in run("density=500")[1]
        for name in ("asset.xml", "prop.json"):
            (tmp_path / "asset" / name).write_text("<mujoco/>")
            assert "nothing was computed" not in run("density=500")[1]
        changed(scale=0.9).export(tmp_path / "mesh.stl")
        assert "nothing was computed" not in run("density=500")[1]
        (tmp_path / "asset" / "asset.json").write_text("[]")
        assert "nothing was computed" not in run("density=500")[1]
        assert "nothing was computed" in run("density=500")[1]

    @pytest.mark.slow
    def test_an_error_that_is_missed_is_status_1(self, run, tmp_path):
        ell().export(tmp_path / "mesh.stl")
        status, said = run("pieces=1", "error=0.001")
        assert status == 1 and "1 convex piece: " in said and "MISSED: the error of 1 mm" in said

    @pytest.mark.slow
    def test_it_says_which_side_is_below(self, run, tmp_path):
        said = run()[1]
        assert "its z axis points up (the default; give up=AXIS if it is another one)" in said
        assert "; on the table it stands on its -z side\n" in said
        assert "its -x axis points up (as given); on the table it stands on its +x side" in run("up=-x")[1]
        leaning = trimesh.creation.box((0.02, 0.02, 0.12))
        leaning.apply_transform(trimesh.transformations.rotation_matrix(0.3, (1, 0, 0)))
        leaning.export(tmp_path / "mesh.stl")
        assert "on the table it fell over and lies on its" in run()[1]


def test_an_unknown_unit_is_no_matter_of_the_command_line_alone():
    with pytest.raises(BadConfig, match="give one of them"):
        make_asset(IntakeRequest("nowhere.stl", mass=1.0, density=1.0))


def test_doubled_faces_are_not_called_open(tmp_path):
    twice = trimesh.Trimesh(BOX.vertices, np.vstack([BOX.faces, BOX.faces[:2]]), process=False)
    told = refusal(tmp_path, "twice.obj", twice.export(file_type="obj"))
    assert "has doubled or inner faces: 5 edges have three or more triangles; remove them" in told


def test_an_stl_that_is_cut_short_is_named_and_what_follows_its_triangles_is_ignored(tmp_path):
    data = BOX.export(file_type="stl")
    count = len(BOX.faces)
    assert f"announces {count} triangles and holds {count - 2}" in refusal(tmp_path, "short.stl", data[:-60])
    text = BOX.export(file_type="stl_ascii").encode()
    for number, content in enumerate((data, data + b"\0" * 77, b"solid" + data[5:], text)):
        (tmp_path / f"{number}.stl").write_bytes(content)
        assert read(str(tmp_path / f"{number}.stl")).manifold.volume() == pytest.approx(BOX.volume, rel=1e-5)


@pytest.mark.parametrize("ending", ["stl", "obj", "glb"])
def test_a_pointer_of_git_lfs_is_called_that(tmp_path, ending):
    pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 12\n"
    assert "is a pointer of Git LFS" in refusal(tmp_path, f"x.{ending}", pointer)
