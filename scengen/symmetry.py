"""Symmetries of a family: changes of its parameters that give the same scene again."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from .errors import BadConfig

T = TypeVar("T")

MOST = 10_000
"""Images after which symmetries are taken for a mistake: seven identical things have 5040."""


@dataclass(frozen=True)
class Symmetry:
    """Two things change places, or the scene is seen in a mirror, or both.

    `Symmetry("identical cubes", swap=("cube_0", "cube_1"))` exchanges all parameters below the two names;
    `Symmetry("mirror", reflect={"y": 0.0, "heading": 0.0})` turns the signs of two parameters.
    """

    name: str
    swap: tuple[str, str] | None = None
    """Two parameters, or two groups of parameters, that change places."""
    reflect: Mapping[str, float] = field(default_factory=dict)
    """Parameters that are mirrored, and the value about which; done after the swap."""

    def source(self, name: str) -> str:
        """The parameter whose value goes to `name`."""
        for one, other in (self.swap, self.swap[::-1]) if self.swap else ():
            if name == one or name.startswith(one + "."):
                return other + name[len(one) :]
        return name

    def check(self, known: Iterable[str]) -> None:
        """Raise unless every parameter that it speaks of exists."""
        names = set(known)
        missing = [n for n in self.reflect if n not in names]
        missing += [n for n in names if self.source(n) not in names]
        if missing or (self.swap and all(self.source(n) == n for n in names)):
            raise BadConfig(f"symmetry {self.name!r} speaks of parameters that do not exist: {missing or self.swap}")


@dataclass(frozen=True)
class Moved:
    """A value that stands where another one stood: `sign * values[source] + offset`."""

    source: str
    sign: float = 1.0
    offset: float = 0.0

    def reflected(self, about: float) -> "Moved":
        """Its mirror image about a value."""
        return Moved(self.source, -self.sign, 2 * about - self.offset)


def motions(names: Iterable[str], symmetries: Sequence[Symmetry]) -> Iterator[dict[str, Moved]]:
    """What symmetries and their combinations do to any parameter values: first nothing, then every image.

    Raises:
        BadConfig: there is no end to it.
    """
    return images({name: Moved(name) for name in names}, symmetries, Moved.reflected)


def images(
    point: Mapping[str, T], symmetries: Sequence[Symmetry], reflect: Callable[[T, float], T]
) -> Iterator[dict[str, T]]:
    """The point itself, then everything that the symmetries and their combinations make of it.

    Args:
        point: parameter values, or their supports, by name.
        reflect: the mirror image of one of them about a value.

    Raises:
        BadConfig: there is no end to it.
    """
    todo, seen = [dict(point)], {_key(point)}
    while todo:
        here = todo.pop()
        yield here
        for symmetry in symmetries:
            there = {name: here[symmetry.source(name)] for name in here}
            there.update({n: reflect(there[n], about) for n, about in symmetry.reflect.items()})
            if (key := _key(there)) not in seen:
                seen.add(key)
                todo.append(there)
        if len(seen) > MOST:
            raise BadConfig(f"the symmetries {', '.join(s.name for s in symmetries)} have more than {MOST} images")


def _key(point: Mapping[str, Any]) -> str:
    """Equal for points that differ by rounding only."""
    return json.dumps({name: _rounded(point[name]) for name in sorted(point)})


def _rounded(x: Any) -> Any:
    if isinstance(x, (int, float)):
        return round(float(x), 9) + 0.0  # -0.0 and 0.0 are one number
    if isinstance(x, Moved):
        return [x.source, x.sign, _rounded(x.offset)]
    return [[_rounded(i.low), _rounded(i.high), i.open_low, i.open_high] for i in x]
