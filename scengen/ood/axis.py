"""An OOD axis: which parameters leave their training support, where they go, and why."""

from collections.abc import Mapping
from dataclasses import dataclass

from ..errors import BadConfig
from ..params import Parameter
from ..samplers.dists import Choice, Dist, Fixed, Integer
from .support import distance, width


@dataclass(frozen=True)
class Proof:
    """Evidence that one parameter of an axis takes no training value."""

    parameter: str
    kind: str
    """`interval`, or `categorical` when one of the two supports is a finite set; `, modulo P` if periodic."""
    gap: float
    """Smallest distance between a training value and a value of the axis, in the parameter's unit."""
    relative: float | None
    """The gap in widths of the training range; None when training knows one value only."""


@dataclass(frozen=True)
class Axis:
    """A named departure from the training distribution."""

    name: str
    why: str
    """What it probes, and why a habit from training fails there."""
    source: str
    replace: Mapping[str, Dist]
    """New distribution of every parameter that moves; all others keep theirs."""

    def prove(self, training: Mapping[str, Dist], known: Mapping[str, Parameter]) -> list[Proof]:
        """Prove that every named parameter leaves its training support.

        Args:
            training: the ID distribution of every parameter, constants included.
            known: the family's parameters by name.

        Raises:
            BadConfig: a support touches or overlaps the training support.
        """
        if not self.replace:
            raise BadConfig(f"axis {self.name} replaces no parameter; name at least one under `replace`")
        return [self._prove(known[name], dist, training[name]) for name, dist in self.replace.items()]

    def _prove(self, parameter: Parameter, there: Dist, here: Dist) -> Proof:
        gap = distance(here.support, there.support, parameter.period)
        if gap <= 0:
            modulo = f" modulo {parameter.period:g}" if parameter.period else ""
            raise BadConfig(
                f"axis {self.name}: {parameter.name} goes to {spell(there)}, which touches or overlaps its "
                f"training range {spell(here)}{modulo} [{parameter.unit}]; move it outside, "
                f"narrow the range in `id`, or drop the axis (~task.axes.{self.name})"
            )
        finite = (Fixed, Choice, Integer)
        kind = "categorical" if isinstance(there, finite) or isinstance(here, finite) else "interval"
        kind += f", modulo {parameter.period:g}" if parameter.period else ""
        span = width(here.support)
        return Proof(parameter.name, kind, gap, gap / span if span > 0 else None)


def spell(dist: Dist) -> str:
    """The distribution's values in a few words: `0.6 to 1.2` or `{0, 90}`."""
    points = [i.low for i in dist.support if i.low == i.high]
    if len(points) < len(dist.support):
        return f"{dist.support[0].low:g} to {dist.support[0].high:g}"
    return "{" + ", ".join(f"{p:g}" for p in points) + "}"
