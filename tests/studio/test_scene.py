"""Scenes in the browser: the robot with few triangles, things as they are."""

import numpy as np
import pytest

pytest.importorskip("viser", reason="no viser; it is in the extra studio")

import trimesh

from scengen import load_task
from scengen.look.looks import PLAIN
from scengen.pictures.render import hide_hulls
from scengen.sim.world import World
from scengen.studio.scene import GRID, PEDESTAL, _meshes, _rounded, _simplification
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
