"""Symmetries of a family: changes of its parameters that give the same scene."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from .errors import BadConfig

T = TypeVar("T")

MAX_IMAGES = 10_000
"""Number of images above which symmetries are taken for a mistake. Seven identical objects have 5040."""


@dataclass(frozen=True)
class Symmetry:
    """Two objects change places, or the scene is mirrored, or both.

    `Symmetry("identical cubes", swap=("cube_0", "cube_1"))` exchanges all parameters below the two names;
    `Symmetry("mirror", reflect={"y": 0.0, "heading": 0.0})` changes the signs of two parameters.
    """

    name: str
    """Name of the symmetry in messages."""
    swap: tuple[str, str] | None = None
    """Two parameters, or two groups of parameters, that change places."""
    reflect: Mapping[str, float] = field(default_factory=dict)
    """Parameters that are mirrored, each with the value about which; applied after the swap."""

    def source(self, name: str) -> str:
        """Parameter whose value goes to `name`."""
        for one, other in (self.swap, self.swap[::-1]) if self.swap else ():
            if name == one or name.startswith(one + "."):
                return other + name[len(one) :]
        return name

    def check(self, known: Iterable[str]) -> None:
        """Raise unless every parameter of the symmetry exists."""
        names = set(known)
        missing = [n for n in self.reflect if n not in names]
        missing += [n for n in names if self.source(n) not in names]
        if missing or (self.swap and all(self.source(n) == n for n in names)):
            raise BadConfig(f"symmetry {self.name!r} names parameters that do not exist: {missing or self.swap}")


@dataclass(frozen=True)
class Moved:
    """Value of a parameter after a symmetry: `sign * values[source] + offset`."""

    source: str
    """Parameter that the value comes from."""
    sign: float = 1.0
    """Factor of that value, 1 or -1."""
    offset: float = 0.0
    """Summand [unit]."""

    def reflected(self, about: float) -> "Moved":
        """Mirror image about a value."""
        return Moved(self.source, -self.sign, 2 * about - self.offset)


def motions(names: Iterable[str], symmetries: Sequence[Symmetry]) -> Iterator[dict[str, Moved]]:
    """Effects of symmetries and their combinations on any parameter values: first the identity, then every image.

    Raises:
        BadConfig: there are more than `MAX_IMAGES`.
    """
    return images({name: Moved(name) for name in names}, symmetries, Moved.reflected)


def images(
    point: Mapping[str, T], symmetries: Sequence[Symmetry], reflect: Callable[[T, float], T]
) -> Iterator[dict[str, T]]:
    """The point itself, then every image of it under the symmetries and their combinations.

    Args:
        point: parameter values, or their supports, by name.
        symmetries: the symmetries.
        reflect: function that mirrors one of the values about a value.

    Raises:
        BadConfig: there are more than `MAX_IMAGES`.
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
        if len(seen) > MAX_IMAGES:
            raise BadConfig(
                f"the symmetries {', '.join(s.name for s in symmetries)} have more than {MAX_IMAGES} images"
            )


def _key(point: Mapping[str, Any]) -> str:
    """Key that is equal for points that differ by rounding only."""
    return json.dumps({name: _rounded(point[name]) for name in sorted(point)})


def _rounded(x: Any) -> Any:
    """A value or support with its numbers rounded."""
    if isinstance(x, (int, float)):
        return round(float(x), 9) + 0.0  # -0.0 and 0.0 are one number
    if isinstance(x, Moved):
        return [x.source, x.sign, _rounded(x.offset)]
    return [[_rounded(i.low), _rounded(i.high), i.open_low, i.open_high] for i in x]
