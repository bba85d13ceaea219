"""Turning a picture moves pixels and changes none, and cameras and places move along with it."""

import itertools

import numpy as np
import pytest

from scengen.assets.prop import TABLE_TOP, table
from scengen.errors import BadConfig
from scengen.export.cameras import calibration
from scengen.orientation import UPRIGHT, VIEW_CENTRE, Orientation
from scengen.sim import scene_text
from scengen.sim.world import World

EIGHT = [Orientation(turns, mirrored) for turns, mirrored in itertools.product(range(4), (False, True))]
WIDTH, HEIGHT = 7, 5
PICTURE = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)


@pytest.fixture(scope="module")
def world():
    return World.load(scene_text.emit(table())[0])


def seen_in(world, camera, point, orientation=UPRIGHT, size=(200, 200)):
    """The pixel in which a camera shows a point."""
    told = calibration(world, camera, *size, orientation)
    x, y, away = np.array(told["intrinsics"]) @ (np.linalg.inv(told["extrinsics"]) @ [*point, 1.0])[:3]
    return np.array([x, y]) / away


def test_the_papers_turn_is_numpys_and_a_mirror_exchanges_columns():
    assert (Orientation(2).apply(PICTURE) == np.rot90(PICTURE, 2)).all()
    assert (Orientation(0, True).apply(PICTURE) == PICTURE[:, ::-1]).all()
    assert (Orientation(2, True).apply(PICTURE) == PICTURE[::-1]).all()


def test_all_eight_differ_and_depth_turns_like_colour():
    square = PICTURE[:, :HEIGHT]
    assert len({one.apply(square).tobytes() for one in EIGHT}) == 8
    for one in EIGHT:
        assert (one.apply(PICTURE[..., 0]) == one.apply(PICTURE)[..., 0]).all()


@pytest.mark.parametrize("one", EIGHT, ids=str)
def test_every_pixel_is_where_the_matrix_says(one):
    seen = one.apply(PICTURE)
    for row, column in itertools.product(range(HEIGHT), range(WIDTH)):
        x, y, scale = one.pixels(WIDTH, HEIGHT) @ [column + 0.5, row + 0.5, 1.0]
        assert scale == 1.0 and (seen[int(y), int(x)] == PICTURE[row, column]).all()


@pytest.mark.parametrize("one", EIGHT, ids=str)
def test_a_policy_that_corrects_the_picture_finds_the_place(one):
    point = np.array([0.13, -0.21, 0.83])
    assert one.stands_at(one.seen_at(point)) == pytest.approx(point)
    assert np.linalg.norm(one.seen_at(point)[:2] - VIEW_CENTRE) == pytest.approx(
        np.linalg.norm(point[:2] - VIEW_CENTRE)
    )


def test_half_a_turn_shows_a_thing_on_the_other_side_of_the_middle():
    assert Orientation(2).seen_at(np.array([0.05, 0.1, 0.8])) == pytest.approx([-0.15, -0.1, 0.8])


def test_the_middle_is_where_agentview_looks_to_2_mm(world):
    middle, beside = (
        seen_in(world, "agentview", [x, VIEW_CENTRE[1], TABLE_TOP]) for x in (VIEW_CENTRE[0], VIEW_CENTRE[0] + 0.002)
    )
    assert np.linalg.norm(middle - [100, 100]) < np.linalg.norm(beside - middle)


@pytest.mark.parametrize("camera", ["agentview", "birdview"])
@pytest.mark.parametrize("one", EIGHT, ids=str)
def test_a_turned_camera_shows_a_step_on_the_table_as_an_upright_one_shows_the_step_that_it_suggests(
    world, camera, one
):
    """To first order: perspective shortens what is farther away, upright or not."""
    middle = np.array([*VIEW_CENTRE, TABLE_TOP])
    for step in ([0.002, 0.0, 0.0], [0.0, 0.002, 0.0]):
        turned = seen_in(world, camera, middle + step, one) - seen_in(world, camera, middle, one)
        upright = seen_in(world, camera, one.seen_at(middle + step)) - seen_in(world, camera, one.seen_at(middle))
        cosine = turned @ upright / np.linalg.norm(turned) / np.linalg.norm(upright)
        assert cosine > np.cos(np.radians(1.0))


@pytest.mark.parametrize("one", EIGHT, ids=str)
def test_only_a_quarter_turn_asks_for_square_pictures(one):
    one.check_size(64, 64)
    if one.turns % 2:
        with pytest.raises(BadConfig, match="must be square: pass width=48, or height=64"):
            one.check_size(64, 48)
    else:
        one.check_size(64, 48)
