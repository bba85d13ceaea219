"""Scenes in the browser: the robot with few triangles, things as they are."""

from unittest.mock import create_autospec

import numpy as np
import pytest

pytest.importorskip("viser", reason="no viser; it is in the extra studio")

import trimesh
import viser

from scengen import load_task
from scengen.look.looks import PLAIN, ROOM
from scengen.pictures.render import hide_hulls
from scengen.sim.world import World
from scengen.studio.scene import GRID, PEDESTAL, ROOM_BODY, SceneView, _meshes, _rounded, _simplification, light
from scengen.validate.rebuilt import rebuild


@pytest.fixture(scope="module", params=["panda_jaw", "panda_suction"])
def world(request):
    task = load_task({"panda_jaw": "domino_single", "panda_suction": "cracker_box_suction"}[request.param])
    made = World.load(rebuild(task.nominal), task.embodiment, look=PLAIN)
    hide_hulls(made.model)
    return made


def shown(world, body, simplified):
    way = _simplification(world, body) if simplified else lambda mesh: _rounded(mesh, GRID)
    return [mesh for mesh, _ in _meshes(world.model, body, way)]


def test_the_robot_has_a_fifth_of_its_triangles_and_its_surface_hardly_moves(world):
    before = after = 0
    for body in sorted(world.own):
        for fine, coarse in zip(shown(world, body, False), shown(world, body, True), strict=True):
            before, after = before + len(fine.faces), after + len(coarse.faces)
            if len(coarse.faces) < len(fine.faces) and PEDESTAL not in world.model.body(body).name:
                points, _ = trimesh.sample.sample_surface(fine, 200, seed=0)
                away = trimesh.proximity.closest_point(coarse, points)[1]
                assert np.quantile(away, 0.95) < 0.0025 and away.max() < 0.012
    assert after < before / 5


def test_things_are_shown_as_they_are(world):
    things = [body for body in range(world.model.nbody) if body not in world.own]
    faces = [[sum(len(mesh.faces) for mesh in shown(world, body, way)) for body in things] for way in (False, True)]
    assert faces[0] == faces[1] and sum(faces[0])


def test_a_page_has_a_room_textures_and_shadows():
    """Everything that is sent to a browser, without one."""
    task = load_task("domino_single")
    world = World.load(rebuild(task.nominal), task.embodiment, look=ROOM)
    sent, api = {}, create_autospec(viser.SceneApi, instance=True)
    api.add_mesh_simple.side_effect = lambda name, *_, **more: sent.update({name: more["cast_shadow"]})
    api.add_mesh_trimesh.side_effect = lambda name, mesh, cast_shadow: sent.update({name: (mesh, cast_shadow)})
    light(api)
    assert api.configure_default_lights.call_args.kwargs == {"cast_shadow": True}
    SceneView(api, "/scene").show(world)
    boards = {name: told for name, told in sent.items() if "board" in name}
    floor = [told for name, told in boards.items() if name.startswith(f"/scene/{ROOM_BODY}/")]
    assert len(boards) == 2 and len(floor) == 1, "a table top and a floor"
    assert all(np.asarray(mesh.visual.material.baseColorTexture).std() > 1 for mesh, _ in boards.values())
    walls = [cast for name, cast in sent.items() if name.startswith(f"/scene/{ROOM_BODY}/") and name not in boards]
    others = [cast for name, cast in sent.items() if not name.startswith(f"/scene/{ROOM_BODY}/")]
    assert walls and not any(walls) and not floor[0][1], "the room throws no shadows"
    assert all(told if isinstance(told, bool) else told[1] for told in others)
    sent.clear()
    SceneView(api, "/twin").show(world, robot=False, room=False)
    assert not [name for name in sent if name.startswith(f"/twin/{ROOM_BODY}/board")]
