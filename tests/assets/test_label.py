"""A label is print: it shows what a package holds, and changes nothing that a hand or a table feels."""

from dataclasses import replace
from itertools import pairwise

import mujoco
import numpy as np
import pytest

from scengen import load_task
from scengen.assets.label import PRINT
from scengen.assets.package import Can, Carton, Tin
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.ycb import ITEMS
from scengen.robots.panda import strip_visual
from scengen.sim import scene_text

LABELLED = [item for item in ITEMS if isinstance(item.prop, Carton | Can | Tin) and item.prop.label]
ALL = pytest.mark.parametrize("item", LABELLED, ids=lambda item: item.folder)


def scene(prop):
    spec = table()
    place(spec, prop, "thing", [0.0, 0.0, TABLE_TOP])
    return spec


def prints(model):
    """Geoms of a scene that are print."""
    body = model.body("thing").id
    return np.flatnonzero((model.geom_bodyid == body) & (model.geom_contype == 0))


@ALL
def test_without_its_label_a_package_is_the_same_to_the_last_bit(item):
    labelled, plain = scene(item.prop), scene(replace(item.prop, label=None))
    strip_visual(labelled)
    strip_visual(plain)
    assert scene_text.emit(labelled)[0] == scene_text.emit(plain)[0]


@ALL
def test_print_neither_weighs_nor_touches_and_stands_out_by_two_layers_at_most(item):
    model, plain = scene(item.prop).compile(), scene(replace(item.prop, label=None)).compile()
    shapes = prints(model)
    assert len(shapes) > 10 and not model.geom_conaffinity[shapes].any()
    assert model.body("thing").mass == plain.body("thing").mass
    np.testing.assert_array_equal(model.body("thing").inertia, plain.body("thing").inertia)

    def reach(compiled, geoms):
        data = mujoco.MjData(compiled)
        mujoco.mj_forward(compiled, data)
        ends = []
        for g in geoms:
            half, rot = compiled.geom_aabb[g, 3:], data.geom_xmat[g].reshape(3, 3)
            signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
            ends.append(data.geom_xpos[g] + (compiled.geom_aabb[g, :3] + signs * half) @ rot.T)
        return np.abs(np.vstack(ends) - [0.0, 0.0, TABLE_TOP]).max(axis=0)

    body = np.flatnonzero((plain.geom_bodyid == plain.body("thing").id) & (plain.geom_contype > 0))
    assert (reach(model, shapes) <= reach(plain, body) + 3 * PRINT).all()


@ALL
def test_a_word_is_read_from_left_to_right_from_both_sides(item):
    """Seen from outside, with up upwards, each letter is to the right of the previous one."""
    model = scene(item.prop).compile()
    for side in ("front", "back"):
        spots = [model.geom(f"thing/{side}_{k}_0").pos for k in range(len(item.prop.label.word))]
        turn = model.geom(f"thing/{side}_0_0").quat
        outward = np.empty(9)
        mujoco.mju_quat2Mat(outward, turn)
        right = np.cross([0.0, 0.0, 1.0], outward.reshape(3, 3)[:, 2])
        assert all((b - a) @ right > 0 for a, b in pairwise(spots))


def test_no_two_packages_say_the_same():
    assert len({item.prop.label.word for item in LABELLED}) == len(LABELLED) == 8


@pytest.mark.parametrize("task", ["pick_place_ycb", "slip_recovery"])
def test_every_object_of_a_task_looks_different_and_its_scene_stays_small(task):
    found = load_task(task)
    draws = [found.draw(split, 0, i).scenario for split in ("id", "unseen_item") for i in range(8)]
    looks = {}
    for scenario in draws:
        text, model = scene_text.emit(scenario.build())[0], scenario.build().compile()
        assert len(text) < 20_000 and text == scene_text.emit(scenario.build())[0]
        shapes = np.flatnonzero(model.geom_bodyid == model.body("thing").id)
        looks.setdefault(
            scenario.thing.row.name, (len(shapes), *map(tuple, np.unique(model.geom_rgba[shapes], axis=0)))
        )
    assert len(looks) >= 4 and len(set(looks.values())) == len(looks)
