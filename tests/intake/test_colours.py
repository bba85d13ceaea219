"""Colours of mesh files survive the intake, and URDF is read by MuJoCo's own reader."""

import json

import mujoco
import numpy as np
import pytest

from scengen.intake.asset import IntakeRequest, _make_asset, make_asset
from scengen.intake.colours import MAX_COLOURS, colours_of
from scengen.intake.urdf import files

trimesh = pytest.importorskip("trimesh", reason="no trimesh; it is in the extra mesh")
from PIL import Image  # noqa: E402

RED, BLUE = (220, 30, 30), (30, 60, 220)
SIZE = (0.06, 0.08, 0.1)


def textured(folder, ending):
    """A box whose texture is red where z is high and blue where it is low, with its material next to it."""
    box = trimesh.creation.box(SIZE)
    corners = box.triangles.reshape(-1, 3)
    uv = np.column_stack([np.full(len(corners), 0.5), corners[:, 2] / SIZE[2] + 0.5])
    picture = np.zeros((64, 64, 3), np.uint8)
    picture[:32], picture[32:] = RED, BLUE  # first row on top
    look = trimesh.visual.TextureVisuals(uv=uv, image=Image.fromarray(picture))
    mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False, visual=look)
    path = folder / f"box.{ending}"
    mesh.export(path)
    return str(path)


@pytest.fixture
def made(monkeypatch):
    """Makes an asset in this process."""
    monkeypatch.setattr("os.dup2", lambda *_: None)
    return lambda path, **settings: _make_asset(IntakeRequest(path, **settings))


@pytest.mark.parametrize("ending", ["obj", "glb"])
def test_a_texture_becomes_patches_of_its_colours(tmp_path, made, ending):
    prop = made(textured(tmp_path, ending), up="z").prop
    assert {tuple(round(255 * c) for c in rgba[:3]) for rgba in prop.palette} == {RED, BLUE}
    for rgba, vertices, faces in prop.looks():
        heights = vertices[faces].mean(axis=1)[:, 2] - SIZE[2] / 2
        inside = abs(heights) > SIZE[2] / 20  # triangles at the border may be of either colour
        assert ((heights[inside] > 0) == (round(255 * rgba[0]) == RED[0])).all()
    model = prop.spec().compile()
    assert len({tuple(c) for c in model.geom_rgba[model.geom_contype == 0].round(3).tolist()}) == 2


def test_colours_of_faces_and_vertices_are_read(tmp_path, made):
    box = trimesh.creation.box(SIZE)
    box.visual.face_colors = [200, 100, 50, 255]
    box.export(tmp_path / "box.ply")
    prop = made(str(tmp_path / "box.ply")).prop
    assert [tuple(round(255 * c) for c in rgba[:3]) for rgba in prop.palette] == [(200, 100, 50)]


def test_a_mesh_without_colours_is_as_before(tmp_path, made):
    trimesh.creation.box(SIZE).export(tmp_path / "box.stl")
    asset = made(str(tmp_path / "box.stl"))
    assert asset.prop.palette == () and asset.figures()["colours"] == 0
    assert asset.prop.written().keys() == type(asset.prop).read(asset.prop.written()).written().keys()


def test_a_palette_is_small(tmp_path):
    path = textured(tmp_path, "obj")
    noise = np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)
    (texture,) = tmp_path.glob("*.png")
    Image.fromarray(noise).save(texture)
    assert len(_make(path).palette) <= MAX_COLOURS


def _make(path):
    return make_asset(IntakeRequest(path)).prop


@pytest.mark.parametrize("there", ["", "../secret.png", "/dev/zero"])
def test_textures_elsewhere_are_not_read(tmp_path, there):
    (tmp_path / "mesh").mkdir()
    path = textured(tmp_path / "mesh", "obj")
    (texture,) = (tmp_path / "mesh").glob("*.png")
    texture.rename(tmp_path / "secret.png")
    (material,) = (tmp_path / "mesh").glob("*.mtl")
    material.write_text(material.read_text().replace(texture.name, there))
    found = colours_of(path, None, "z", 0)
    assert found is None or (np.ptp(found[1].astype(int), axis=0) == 0).all(), "no colour of the texture is seen"


def test_mujocos_own_reader_finds_the_same_body_in_the_urdf(tmp_path, made):
    asset = made(textured(tmp_path, "obj"), mass=0.3)
    for name, content in files(asset.prop):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "asset.urdf"))
    told = json.loads(json.dumps(asset.figures()))
    assert model.body_mass[-1] == pytest.approx(0.3) and model.body_ipos[-1] == pytest.approx(told["centre_of_mass"])
    inertia = np.sort(np.linalg.eigvalsh(told["inertia"]))
    assert np.sort(model.body_inertia[-1]) == pytest.approx(inertia, rel=1e-6)
    solid = model.geom_contype != 0
    assert solid.sum() == len(asset.prop.corners) + len(asset.prop.feet) and (~solid).sum() == len(asset.prop.palette)
    assert {tuple(c) for c in model.geom_rgba[~solid].astype(float).round(3).tolist()} == set(asset.prop.palette)
