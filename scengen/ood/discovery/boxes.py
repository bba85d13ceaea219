"""Boxes of points in which memories broke, with their evidence."""

from collections.abc import Sequence

from .trial import Point, Range, RegionBox, SearchTrial


def boxes(trials: Sequence[SearchTrial]) -> list[tuple[int, RegionBox]]:
    """Boxes in which memories broke, each after its evidence, most evidence first.

    A box of two regions is left out if one of the regions has a separate box.
    """
    where: dict[tuple[int, ...], list[SearchTrial]] = {}
    for trial in trials:
        where.setdefault(trial.point.regions, []).append(trial)
    found = list[tuple[int, RegionBox]]()
    alone = set[int]()
    for regions in sorted(where, key=len):
        if len(regions) == 2 and alone.intersection(regions):
            continue
        if best := _best(where[regions]):
            found.append(best)
            alone.update(regions if len(regions) == 1 else ())
    return sorted(found, key=lambda f: (-f[0], len(f[1].ranges), f[1].ranges))


def _best(trials: Sequence[SearchTrial]) -> tuple[int, RegionBox] | None:
    """The box with the highest `breaks - 2 * others`; None if no trial breaks the memory.

    Args:
        trials: trials in the same regions.
    """
    broken = [trial.point for trial in trials if trial.breaks]
    best: tuple[int, float, RegionBox] | None = None
    for one in broken:
        for other in broken:
            box = _spanned(one, other)
            inside = [trial.breaks for trial in trials if box.holds(trial.point)]
            score = sum(inside) - 2 * (len(inside) - sum(inside))
            size = sum(part.high - part.low for part in box.ranges)
            if best is None or (score, size) > best[:2]:
                best = (score, size, box)
    return (best[0], best[2]) if best else None


def _spanned(one: Point, other: Point) -> RegionBox:
    """The box with two points as opposite corners."""
    corners = zip(one, other, strict=True)
    return RegionBox(tuple(Range(a.region, min(a.at, b.at), max(a.at, b.at)) for a, b in corners))
