"""A chain's parameters say where its tiles stand, and a defect changes nothing but what it names."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen.assets.box import Domino
from scengen.assets.chain import DECOY, DRIFT, GAP, MISSING, Chain, Defect, Lanes

TILE = Domino(height=0.05, width=0.025, thickness=0.008)
SLAB = Domino(height=0.11, width=0.04, thickness=0.012)


def chain(defect=None, count=4, gap=0.031, starter=TILE):
    return Chain(count, gap, starter, TILE, SLAB, defect)


@given(count=st.integers(3, 8), gap=st.floats(0.01, 0.05))
def test_an_intact_chain_has_equal_gaps_and_the_origin_in_its_middle(count, gap):
    feet = np.array([foot[0] for foot in chain(count=count, gap=gap).feet.values()])
    rear = feet - [*[TILE.thickness / 2] * count, SLAB.thickness / 2]
    assert rear[1:] - rear[:-1] == pytest.approx(TILE.thickness + gap)
    assert rear[0] == pytest.approx(-rear[-1]), "measured from the first face that is pushed to the face of the slab"


def test_a_stout_starter_is_pushed_where_a_slender_one_is_and_the_gaps_stay():
    stout = Domino(height=0.03, width=0.025, thickness=0.02)
    slender, feet = chain().feet, chain(starter=stout).feet
    assert feet[0][0] - stout.thickness / 2 == pytest.approx(slender[0][0] - TILE.thickness / 2)
    for i in range(1, 5):
        assert feet[i][0] - slender[i][0] == pytest.approx(stout.thickness - TILE.thickness)


@given(place=st.floats(0.0, 1.0), count=st.integers(3, 8), side=st.sampled_from([0, 1]), offset=st.floats(1.02, 2.5))
@settings(max_examples=50, deadline=None)
def test_place_and_offset_say_which_tile_stands_beside_the_chain_and_by_how_much(place, count, side, offset):
    feet = chain(Defect(kind=GAP, place=place, side=side, offset=offset), count).feet
    out = [i for i, foot in feet.items() if abs(foot[1]) > 1e-9]
    assert out == [1 + min(int(place * (count - 1)), count - 2)]
    assert feet[out[0]][1] == pytest.approx((1 if side else -1) * offset * TILE.width)
    assert abs(feet[out[0]][1]) > TILE.width, "it would still be struck"


@given(stretch=st.floats(1.02, 1.6), count=st.integers(3, 8), gap=st.floats(0.029, 0.047))
@settings(max_examples=50, deadline=None)
def test_a_drifting_chain_is_as_long_as_an_intact_one_and_each_space_wider_than_the_last(stretch, count, gap):
    gaps = chain(Defect(kind=DRIFT, stretch=stretch), count, gap).gaps
    assert sum(gaps) == pytest.approx(count * gap)
    assert gaps[-1] == pytest.approx(stretch * TILE.height)
    assert all(wider / narrower == pytest.approx(gaps[1] / gaps[0]) for narrower, wider in itertools.pairwise(gaps))


@pytest.mark.parametrize("kind", [GAP, DRIFT, DECOY, MISSING])
def test_whatever_is_wrong_the_first_tile_and_the_slab_stand_where_they_do_in_an_intact_chain(kind):
    feet, intact = chain(Defect(kind=kind)).feet, chain().feet
    assert feet[0] == pytest.approx(intact[0]) and feet[4] == pytest.approx(intact[4])
    assert len(feet) == len(intact) - (kind == MISSING)


@pytest.mark.parametrize(("side", "room"), [(0, 0.065), (1, 0.0275)])
def test_the_room_between_lanes_is_that_of_the_tiles_that_come_nearest_to_each_other(side, room):
    """90 mm apart, tiles of 25 mm leave 65; one that stands 37.5 mm to the left leaves 90 - 37.5 - 25."""
    aside = Defect(kind=GAP, offset=1.5, side=side)
    assert Lanes((chain(aside), chain()), 0.09).room == pytest.approx(room)


def test_one_slab_stands_across_all_lanes_but_that_of_the_decoy():
    """Four lanes of 90 mm with slabs of 40 mm: 3 * 90 + 40. Beside it the decoy's leaves 90 - 40."""
    lanes = Lanes((chain(Defect(kind=DECOY)), *[chain()] * 4), 0.09)
    assert lanes.slab.width == pytest.approx(0.31)
    assert lanes.feet["slab"][1] - lanes.feet["decoy"][1] == pytest.approx(2.5 * 0.09)
    assert lanes.feet["slab"][0] == pytest.approx(lanes.feet["decoy"][0]) and lanes.room == pytest.approx(0.05)
