"""Rectangles cut into L-shaped pieces, in exact arithmetic, and all ways to reassemble such pieces.

Every cut is a guillotine cut: straight, from edge to edge of the rectangle that it cuts. Two neighbouring rectangles
together form an L. Two ways of cutting give such pieces only:

    framed                stairs            `framed` leaves a rectangle to cut further; `stairs` leaves none.
    +-+---------+         +----+----+
    | |         |         |    | 2  |
    |1|  rest   |         | 2  +----+
    | +---------+         +----+ 1  |
    | :   1     |         |  1 :    |
    +-+---------+         +----+----+

Lengths are whole numbers or fractions in any unit, so that `closes` can check exactly whether pieces tile a rectangle.
"""

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

Length = Fraction | int


@dataclass(frozen=True)
class Rect:
    """The points between (x0, y0) and (x1, y1)."""

    x0: Fraction
    y0: Fraction
    x1: Fraction
    y1: Fraction

    @classmethod
    def sized(cls, width: Length, height: Length) -> "Rect":
        """A rectangle with its lower left corner at the origin."""
        return cls(Fraction(0), Fraction(0), Fraction(width), Fraction(height))

    def __post_init__(self) -> None:
        if not (self.x0 < self.x1 and self.y0 < self.y1):
            raise ValueError(f"a rectangle from ({self.x0}, {self.y0}) to ({self.x1}, {self.y1}) is empty")

    @cached_property
    def width(self) -> Fraction:
        return self.x1 - self.x0

    @cached_property
    def height(self) -> Fraction:
        return self.y1 - self.y0

    @cached_property
    def area(self) -> Fraction:
        return self.width * self.height

    def cut_x(self, at: Length) -> tuple["Rect", "Rect"]:
        """The left part, `at` wide, and the right part."""
        x = self.x0 + Fraction(at)
        return Rect(self.x0, self.y0, x, self.y1), Rect(x, self.y0, self.x1, self.y1)

    def cut_y(self, at: Length) -> tuple["Rect", "Rect"]:
        """The lower part, `at` high, and the upper part."""
        y = self.y0 + Fraction(at)
        return Rect(self.x0, self.y0, self.x1, y), Rect(self.x0, y, self.x1, self.y1)


@dataclass(frozen=True)
class Ell:
    """An L where it was cut: the rectangle `bounds` without the rectangle `notch` at one of its corners."""

    bounds: Rect
    notch: Rect

    def __post_init__(self) -> None:
        b, n = self.bounds, self.notch
        inside = b.x0 <= n.x0 and n.x1 <= b.x1 and b.y0 <= n.y0 and n.y1 <= b.y1
        corner = (n.x0 == b.x0) != (n.x1 == b.x1) and (n.y0 == b.y0) != (n.y1 == b.y1)
        if not (inside and corner):
            raise ValueError("not an L; the notch must lie at one corner, and be smaller than the rectangle in x and y")

    @cached_property
    def area(self) -> Fraction:
        return self.bounds.area - self.notch.area

    @cached_property
    def quarter(self) -> int:
        """Number of counterclockwise quarter turns that bring an L with its notch at the upper right to this pose."""
        right, upper = self.notch.x1 == self.bounds.x1, self.notch.y1 == self.bounds.y1
        return {(True, True): 0, (False, True): 1, (False, False): 2, (True, False): 3}[right, upper]

    @cached_property
    def sides(self) -> tuple[Fraction, Fraction, Fraction, Fraction]:
        """Width, height, width of the upright arm and height of the lying arm, with the notch at the upper right."""
        across, along = (self.bounds.width, self.notch.width), (self.bounds.height, self.notch.height)
        if self.quarter % 2:
            across, along = along, across
        return across[0], along[0], across[0] - across[1], along[0] - along[1]

    @cached_property
    def middle(self) -> tuple[Fraction, Fraction]:
        """Centre of `bounds`."""
        return (self.bounds.x0 + self.bounds.x1) / 2, (self.bounds.y0 + self.bounds.y1) / 2

    @cached_property
    def corners(self) -> list[tuple[Fraction, Fraction]]:
        """The outline, counterclockwise: six points."""
        b, n = self.bounds, self.notch
        right, upper = n.x1 == b.x1, n.y1 == b.y1
        ring = [(b.x0, b.y0), (b.x1, b.y0), (b.x1, b.y1), (b.x0, b.y1)]
        gone = (b.x1 if right else b.x0, b.y1 if upper else b.y0)
        inner = (n.x0 if right else n.x1, n.y0 if upper else n.y1)
        at = ring.index(gone)
        before, after = ring[at - 1], ring[(at + 1) % 4]
        enters = (gone[0], inner[1]) if before[0] == gone[0] else (inner[0], gone[1])
        leaves = (gone[0], inner[1]) if after[0] == gone[0] else (inner[0], gone[1])
        return [*ring[:at], enters, inner, leaves, *ring[at + 1 :]]


class Cut(NamedTuple):
    """A rectangle that is cut into pieces: they prove that it can be tiled with them."""

    pieces: tuple[Ell, ...]
    """Pieces where they were cut."""
    rect: Rect
    """The rectangle; its lower left corner is at the origin."""

    def mirrored(self) -> "Cut":
        """The mirror image: left and right exchanged."""
        return Cut(mirrored(self.pieces, self.rect), self.rect)

    def like(self, other: "Cut") -> bool:
        """Whether the pieces of another cut have the same shapes, in their order."""
        return all(mine.sides == its.sides for mine, its in zip(self.pieces, other.pieces, strict=True))

    def dealt(self, deal: int) -> "Cut":
        """The same cut with its first three pieces in another order, the permutation of number `deal`."""
        return Cut((*list(itertools.permutations(self.pieces[:3]))[deal], *self.pieces[3:]), self.rect)


def three(frame: Length, left: Length, right: Length, low: Length, rise: Length, top: Length) -> Cut:
    """Cut a rectangle in three: a piece `frame` wide frames a rectangle that a staircase divides.

    Args:
        frame: width of both arms of the first piece.
        left: width of the framed rectangle left of the staircase's step.
        right: width right of it.
        low: height of the lower piece left of the step.
        rise: height by which it is higher right of the step.
        top: height of the upper piece there.
    """
    rect = Rect.sized(frame + left + right, frame + low + rise + top)
    first, rest = framed(rect, frame, frame)
    return Cut((first, *stairs(rest, left, low, low + rise)), rect)


def four(left: Length, right: Length, low: Length, rise: Length, top: Length) -> Cut:
    """Cut a rectangle in two halves and each by a staircase, the second one downwards; lengths as in `three`."""
    rect = Rect.sized(2 * (left + right), low + rise + top)
    one, two = rect.cut_x(left + right)
    return Cut((*stairs(one, left, low, low + rise), *stairs(two, left, low + rise, low)), rect)


def framed(rect: Rect, upright: Length, lying: Length) -> tuple[Ell, Rect]:
    """Cut an L off the left and lower side of `rect`, with arms `upright` wide and `lying` high.

    Returns:
        The L and the remaining rectangle.
    """
    _, right = rect.cut_x(upright)
    _, rest = right.cut_y(lying)
    return Ell(rect, rest), rest


def stairs(rect: Rect, step: Length, left: Length, right: Length) -> tuple[Ell, Ell]:
    """Cut `rect` in two at `step` from the left, and these parts at heights `left` and `right`.

    Returns:
        The lower and the upper L.
    """
    if left == right:
        raise ValueError(f"both cuts are at height {left}, which leaves two rectangles; give two different heights")
    one, two = rect.cut_x(step)
    (_, a_up), (_, b_up) = one.cut_y(left), two.cut_y(right)
    (a_low, _), (b_low, _) = one.cut_y(left), two.cut_y(right)
    middle_low, middle_up = max(a_low.y1, b_low.y1), min(a_up.y0, b_up.y0)
    lower = Rect(rect.x0, rect.y0, rect.x1, middle_low)
    upper = Rect(rect.x0, middle_up, rect.x1, rect.y1)
    shallow, deep = (one, two) if left < right else (two, one)
    notch_low = Rect(shallow.x0, middle_up, shallow.x1, middle_low)
    notch_up = Rect(deep.x0, middle_up, deep.x1, middle_low)
    return Ell(lower, notch_low), Ell(upper, notch_up)


def mirrored(pieces: Sequence[Ell], rect: Rect) -> tuple[Ell, ...]:
    """Mirror images of the pieces within `rect`: left and right exchanged."""

    def flip(r: Rect) -> Rect:
        return Rect(rect.x0 + rect.x1 - r.x1, r.y0, rect.x0 + rect.x1 - r.x0, r.y1)

    return tuple(Ell(flip(p.bounds), flip(p.notch)) for p in pieces)


def closes(pieces: Sequence[Ell], rect: Rect) -> bool:
    """Whether the pieces tile `rect`: areas add up, and every inner edge occurs once in each direction.

    Both checks are exact. Edges are compared as sets of elementary steps between neighbouring coordinates in use.
    """
    if sum((p.area for p in pieces), Fraction(0)) != rect.area:
        return False
    outlines = [p.corners for p in pieces]
    frame = [(rect.x0, rect.y0), (rect.x1, rect.y0), (rect.x1, rect.y1), (rect.x0, rect.y1)]
    marks = sorted({c for outline in [*outlines, frame] for corner in outline for c in corner})
    left: Counter[tuple] = Counter()
    for outline in outlines:
        left.update(_steps(outline, marks))
    left.subtract(_steps(frame, marks))
    return all(count == left[end, start] for (start, end), count in list(left.items()))


def _steps(outline: Sequence[tuple], marks: Sequence[Fraction]) -> Iterator[tuple]:
    """The directed elementary edges of a closed rectilinear outline."""
    for (xa, ya), (xb, yb) in zip(outline, [*outline[1:], outline[0]], strict=True):
        axis, (a, b) = (0, (xa, xb)) if ya == yb else (1, (ya, yb))
        stops = [m for m in marks if min(a, b) <= m <= max(a, b)]
        for low, high in itertools.pairwise(stops):
            start, end = ((low, ya), (high, ya)) if axis == 0 else ((xa, low), (xa, high))
            yield (start, end) if a < b else (end, start)


# --- all ways to reassemble the pieces ------------------------------------------------------------


def solutions(pieces: Sequence[Ell], rect: Rect) -> int:
    """Number of ways to tile `rect` with the pieces turned by quarter turns, but not turned over.

    Pieces of the same shape count as the same. In a tiling without gaps every edge lies at a sum of side lengths, so
    that the common grid of all lengths contains all possible positions.
    """
    grid = _grid(pieces, rect)
    columns, rows = int(rect.width * grid), int(rect.height * grid)
    kinds = Counter(tuple(int(side * grid) for side in p.sides) for p in pieces)
    full = (1 << columns * rows) - 1
    if sum((p.area for p in pieces), Fraction(0)) != rect.area:
        return 0
    poses = {kind: _poses(kind, columns, rows) for kind in kinds}
    return _count(0, full, kinds, poses)


def misfit(pieces: Sequence[Ell], rect: Rect) -> tuple[int, Ell]:
    """Index of a piece, and an L of the same area with which the other pieces cannot tile `rect` in any arrangement.

    The L is the piece's mirror image, if the others cannot tile with that. Some pieces equal their mirror image, and
    with some the mirror image of the whole tiling exists. Sides are whole numbers.
    """
    for i, piece in enumerate(pieces):
        for other in _same_area(piece):
            if solutions([*pieces[:i], other, *pieces[i + 1 :]], rect) == 0:
                return i, other
    raise ValueError("every L of the same area fits, which no known rectangle allows; give other pieces")


def _same_area(piece: Ell) -> Iterator[Ell]:
    """The mirror image of an L, then every L of the same area with whole sides that are up to two longer."""
    yield mirrored([piece], piece.bounds)[0]
    width, height, upright, lying = (int(side) for side in piece.sides)
    for w, h, u, v in itertools.product(range(3, width + 3), range(3, height + 3), range(2, width), range(2, height)):
        if u < w and v < h and w * v + u * (h - v) == piece.area and (w, h, u, v) != (width, height, upright, lying):
            bounds = Rect.sized(w, h)
            yield Ell(bounds, Rect(Fraction(u), Fraction(v), bounds.x1, bounds.y1))


def _grid(pieces: Sequence[Ell], rect: Rect) -> int:
    """Smallest number of grid lines per unit of length such that all lengths are on the grid."""
    lengths = [rect.width, rect.height, *(side for p in pieces for side in p.sides)]
    return math.lcm(*(length.denominator for length in lengths))


Kind = tuple[int, ...]


def _poses(kind: Kind, columns: int, rows: int) -> list[int]:
    """Every position and quarter turn of an L within the grid, each as a bit set of cells."""
    width, height, upright, lying = kind
    cells = {(x, y) for x in range(width) for y in range(height) if x < upright or y < lying}
    shapes = []
    for _ in range(4):
        if cells not in shapes:
            shapes.append(cells)
        top = max(y for _, y in cells)
        cells = {(top - y, x) for x, y in cells}
    found = []
    for shape in shapes:
        wide, high = max(x for x, _ in shape) + 1, max(y for _, y in shape) + 1
        base = sum(1 << y * columns + x for x, y in shape)
        found += [base << y * columns + x for y in range(rows - high + 1) for x in range(columns - wide + 1)]
    return found


def _count(covered: int, full: int, left: Counter[Kind], poses: dict[Kind, list[int]]) -> int:
    """Number of exact covers: one of the pieces must cover the first free cell."""
    if covered == full:
        return 1
    first = ~covered & (covered + 1)
    total = 0
    for kind in [k for k in left if left[k]]:
        left[kind] -= 1
        for pose in poses[kind]:
            if pose & first and not pose & covered:
                total += _count(covered | pose, full, left, poses)
        left[kind] += 1
    return total
