"""Cutting is exact: areas and outlines close, pieces are disjoint, and all ways to put them back are counted."""

import itertools
from fractions import Fraction

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from scengen.assets.guillotine import Ell, Rect, closes, framed, mirrored, misfit, solutions, stairs

lengths = st.fractions(min_value=Fraction(1, 7), max_value=9, max_denominator=60)


@st.composite
def cuts(draw):
    """A rectangle and the Ls that it was cut into: frames around frames, then stairs."""
    rest = rect = Rect.sized(draw(lengths), draw(lengths))
    pieces = []
    for _ in range(draw(st.integers(0, 2))):
        piece, rest = framed(rest, share(draw) * rest.width, share(draw) * rest.height)
        pieces.append(piece)
    low, high = sorted((share(draw), share(draw)))
    assume(low != high)
    pair = (low, high) if draw(st.booleans()) else (high, low)
    pieces += stairs(rest, share(draw) * rest.width, *(h * rest.height for h in pair))
    return rect, mirrored(pieces, rect) if draw(st.booleans()) else tuple(pieces)


def share(draw):
    return draw(st.fractions(min_value=Fraction(1, 20), max_value=Fraction(19, 20), max_denominator=20))


def boxes(piece):
    """The two rectangles that make up an L: what lies below or above the notch, and what lies beside it."""
    b, n = piece.bounds, piece.notch
    low = n.y0 == b.y0
    whole = Rect(b.x0, n.y1, b.x1, b.y1) if low else Rect(b.x0, b.y0, b.x1, n.y0)
    beside = Rect(n.x1, n.y0, b.x1, n.y1) if n.x0 == b.x0 else Rect(b.x0, n.y0, n.x0, n.y1)
    return whole, beside


def common(one, other):
    """Area that two rectangles have in common."""
    wide = min(one.x1, other.x1) - max(one.x0, other.x0)
    high = min(one.y1, other.y1) - max(one.y0, other.y0)
    return max(wide, 0) * max(high, 0)


def moved(piece, by):
    b, n = (Rect(r.x0 + by, r.y0, r.x1 + by, r.y1) for r in (piece.bounds, piece.notch))
    return Ell(b, n)


def tromino(x, y, notch_x, notch_y):
    return Ell(
        Rect(*map(Fraction, (x, y, x + 2, y + 2))), Rect(*map(Fraction, (notch_x, notch_y, notch_x + 1, notch_y + 1)))
    )


@given(cuts())
@settings(deadline=None, max_examples=40)
def test_pieces_are_disjoint_inside_and_their_areas_add_up_exactly(cut):
    rect, pieces = cut
    assert sum(p.area for p in pieces) == rect.area
    parts = [boxes(p) for p in pieces]
    for one, other in itertools.combinations(parts, 2):
        assert all(common(a, b) == 0 for a in one for b in other)
    assert all(common(box, rect) == box.area for part in parts for box in part)


@given(cuts())
@settings(deadline=None, max_examples=40)
def test_the_plan_closes_and_no_piece_of_it_can_move_or_turn_over(cut):
    rect, pieces = cut
    assert closes(pieces, rect)
    for i, piece in enumerate(pieces):
        others = [*pieces[:i], *pieces[i + 1 :]]
        assert not closes([*others, moved(piece, Fraction(1, 10**9))], rect)
        assert not closes([*others, *mirrored([piece], piece.bounds)], rect)
        assert not closes(others, rect)


def test_equal_areas_are_not_enough():
    """Two Ls in one place and a hole in the other: the areas add up, the outlines do not."""
    rect = Rect.sized(3, 2)
    one, other = tromino(0, 0, 1, 1), tromino(1, 0, 1, 0)
    assert closes([one, other], rect)
    assert 2 * one.area == rect.area and not closes([one, one], rect)


@given(cuts())
@settings(deadline=None, max_examples=40)
def test_an_outline_runs_counterclockwise_around_its_area(cut):
    for piece in cut[1]:
        ring = piece.corners
        twice = sum(xa * yb - xb * ya for (xa, ya), (xb, yb) in zip(ring, [*ring[1:], ring[0]], strict=True))
        assert len(set(ring)) == 6 and twice == 2 * piece.area


@given(cuts())
@settings(deadline=None, max_examples=40)
def test_sides_and_quarter_turns_rebuild_a_piece_in_its_place(cut):
    for piece in cut[1]:
        width, height, upright, lying = piece.sides
        x, y = width / 2, height / 2
        ring = [(-x, -y), (x, -y), (x, lying - y), (upright - x, lying - y), (upright - x, y), (-x, y)]
        for _ in range(piece.quarter):
            ring = [(-y, x) for x, y in ring]
        middle = piece.middle
        assert {(middle[0] + x, middle[1] + y) for x, y in ring} == set(piece.corners)


@given(st.fractions(min_value=Fraction(1, 5), max_value=3, max_denominator=5), st.integers(2, 4), st.integers(2, 5))
@settings(deadline=None, max_examples=15)
def test_the_cut_itself_is_a_solution_and_their_number_knows_no_unit(unit, step, low):
    whole = Rect.sized(8, 9)
    first, rest = framed(whole, 2, 2)
    pieces = [first, *stairs(rest, step, low, low + 1)]
    scaled = [Ell(*(Rect(*(unit * c for c in (r.x0, r.y0, r.x1, r.y1))) for r in (p.bounds, p.notch))) for p in pieces]
    assert solutions(scaled, Rect.sized(8 * unit, 9 * unit)) == solutions(pieces, whole) >= 1


@pytest.mark.parametrize(
    ("width", "height", "ways"), [(2, 3, 2), (3, 4, 4), (3, 6, 8), (4, 6, 18), (5, 6, 72), (6, 6, 162), (3, 3, 0)]
)
def test_there_are_as_many_ways_to_tile_with_l_trominoes_as_is_known(width, height, ways):
    """Known numbers of tilings of a rectangle by L-trominoes; 2 to the power of n for 3 by 2 n."""
    pieces = [tromino(0, 0, 1, 1)] * (width * height // 3)
    assert solutions(pieces, Rect.sized(width, height)) == ways


def test_pieces_are_not_turned_over():
    """Two L-tetrominoes of one hand fill 4 by 2 in one way, of either hand in none."""
    rect = Rect.sized(4, 2)
    one = Ell(Rect.sized(3, 2), Rect(Fraction(1), Fraction(1), Fraction(3), Fraction(2)))
    (mirror,) = mirrored([one], one.bounds)
    assert (solutions([one, one], rect), solutions([mirror, mirror], rect), solutions([one, mirror], rect)) == (1, 1, 0)


@given(st.integers(2, 3), st.integers(2, 4), st.integers(2, 4), st.integers(1, 2), st.booleans())
@settings(deadline=None, max_examples=15)
def test_with_a_misfit_of_the_same_area_there_is_no_way_to_tile_the_rectangle(frame, step, low, rise, mirror):
    whole = Rect.sized(frame + step + 2, frame + low + rise + 2)
    first, rest = framed(whole, frame, frame)
    pieces = (first, *stairs(rest, step, low, low + rise))
    pieces = mirrored(pieces, whole) if mirror else pieces
    i, other = misfit(pieces, whole)
    assert other.area == pieces[i].area and solutions(pieces, whole) >= 1
    assert solutions([*pieces[:i], other, *pieces[i + 1 :]], whole) == 0


@pytest.mark.parametrize(
    "make",
    [
        lambda: Rect.sized(0, 2),
        lambda: Rect.sized(2, 3).cut_x(2),
        lambda: Rect.sized(2, 3).cut_y(Fraction(7, 2)),
        lambda: stairs(Rect.sized(4, 4), 2, 1, 1),
        lambda: Ell(Rect.sized(3, 3), Rect(*map(Fraction, (1, 1, 2, 2)))),
        lambda: Ell(Rect.sized(3, 3), Rect(*map(Fraction, (0, 1, 3, 3)))),
    ],
)
def test_what_is_no_rectangle_and_no_l_is_refused(make):
    with pytest.raises(ValueError, match=r"rectangle|L:|stairs"):
        make()
