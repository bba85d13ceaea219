"""An OOD axis: the parameters that leave their training support, their new distributions, and the reason."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from ..errors import BadConfig
from ..params import Parameter, Value
from ..symmetry import Symmetry, images
from .dists import Choice, Dist, Fixed, Integer
from .support import Interval, Support, distance, meet, nearest, turned, width, wrapped


@dataclass(frozen=True)
class Proof:
    """Evidence that one parameter of an axis takes no training value."""

    parameter: str
    """Name of the parameter."""
    kind: str
    """`interval`, or `categorical` if one of the two supports is a finite set; followed by `, modulo P` if it is
    periodic."""
    gap: float
    """Smallest distance between a training value and a value of the axis, in the parameter's unit."""
    relative: float | None
    """Gap in widths of the training range; None if training has only one value."""


@dataclass(frozen=True)
class Axis:
    """A named departure from the training distribution."""

    name: str
    """Name of the axis."""
    why: str
    """Ability that the axis probes, and the reason why a habit from training fails there."""
    source: str
    """Source of the axis, such as a section of the paper."""
    replace: Mapping[str, Dist]
    """New distribution of every parameter that moves. All others keep theirs."""
    severities: int = 0
    """Number of severities, `name@1` to `name@severities`; 0 if there are none."""
    limits: Mapping[str, float] = field(default_factory=dict)
    """Measured ends of the path by parameter, from conf/limits: the values at which the oracle fails."""

    def prove(
        self,
        training: Mapping[str, Dist],
        known: Mapping[str, Parameter],
        symmetries: Sequence[Symmetry] = (),
    ) -> list[Proof]:
        """Prove that every named parameter leaves its training support, and that no symmetry leads back into it.

        Args:
            training: the ID distribution of every parameter, constants included.
            known: the family's parameters by name.
            symmetries: changes of the parameters that give the same scene.

        Raises:
            BadConfig: a support touches or overlaps the training support.
        """
        if not self.replace:
            raise BadConfig(f"axis {self.name} replaces no parameter; name at least one under `replace`")
        proofs = [self._prove(known[name], dist, training[name]) for name, dist in self.replace.items()]
        self._check_symmetries(training, known, symmetries)
        return proofs

    def at(self, severity: int, training: Mapping[str, Dist], known: Mapping[str, Parameter]) -> "Axis":
        """The axis at one severity: every value is at `severity / severities` of the path from training to the far end.

        The path of a value starts at the nearest training value. It ends at the far end of its range, or at the
        measured limit if there is one. A range thus becomes one value; several separate values remain several.

        Raises:
            BadConfig: there is no such severity, or a whole number would have to be a fraction.
        """
        if not 1 <= severity <= self.severities:
            has = f"has severities 1 to {self.severities}"
            none = "has none: give it `severities: N` in the task file"
            raise BadConfig(f"split {self.name}@{severity}: the axis {has if self.severities else none}")
        dists = self.along(severity / self.severities, training, known)
        return replace(self, name=f"{self.name}@{severity}", replace=dists, severities=0)

    def along(
        self, fraction: float, training: Mapping[str, Dist], known: Mapping[str, Parameter]
    ) -> dict[str, Fixed | Choice]:
        """Distributions of the axis' parameters at a fraction of the path: 0 is the edge of training, 1 the far end.

        Raises:
            BadConfig: a whole number would have to be a fraction.
        """
        return {n: self._on_path(fraction, known[n], d, training[n].support) for n, d in self.replace.items()}

    def _prove(self, parameter: Parameter, there: Dist, here: Dist) -> Proof:
        """Prove that one parameter leaves its training support.

        Raises:
            BadConfig: it does not.
        """
        gap = distance(here.support, there.support, parameter.period)
        if gap <= 0:
            modulo = f" modulo {parameter.period:g}" if parameter.period else ""
            shared = meet(here.support, there.support, parameter.period)
            how = "both have values in common" if shared else "no value in common, but no gap either"
            raise BadConfig(
                f"axis {self.name}: {parameter.name} goes to {spell(there)}, which touches or overlaps its "
                f"training range {spell(here)}{modulo} [{parameter.unit}] ({how}); move it outside, "
                f"narrow the range in `id`, or {self._dropped}"
            )
        finite = (Fixed, Choice, Integer)
        kind = "categorical" if isinstance(there, finite) or isinstance(here, finite) else "interval"
        kind += f", modulo {parameter.period:g}" if parameter.period else ""
        span = width(here.support)
        return Proof(parameter.name, kind, gap, gap / span if span > 0 else None)

    @property
    def _dropped(self) -> str:
        """Remedy of last resort, for an axis of the task's file and for one that the command line adds."""
        name = self.name.partition("@")[0]
        here = f"~task.axes.{name} for one command, or leave +task.axes.{name} out"
        return f"drop the axis from the task's file, with {here}"

    def _check_symmetries(
        self, training: Mapping[str, Dist], known: Mapping[str, Parameter], symmetries: Sequence[Symmetry]
    ) -> None:
        """Raise if a symmetric image of the training scenes contains scenes of the axis.

        Two scenes differ if any one parameter differs, whether the axis names it or not.
        """
        here = {name: dist.support for name, dist in training.items()}
        there = {**here, **{name: dist.support for name, dist in self.replace.items()}}
        for image in images(here, symmetries, reflected):
            if all(distance(there[n], image[n], known[n].period) <= 0 for n in there):
                raise BadConfig(
                    f"axis {self.name}: {', '.join(self.replace)} move, but the scenes are training scenes again under "
                    f"the symmetries of the family ({', '.join(s.name for s in symmetries)}); move a parameter that "
                    f"they do not take back, or {self._dropped}"
                )

    def _on_path(self, fraction: float, parameter: Parameter, dist: Dist, training: Support) -> Fixed | Choice:
        """Distribution of one parameter at a fraction of its path."""
        whole = isinstance(dist, Integer)  # its values are separate, but lie on one path
        ranges = (Interval(dist.low, dist.high),) if whole else dist.support
        listed = [Interval(v, v) for v in dist.options] if isinstance(dist, Choice) else ranges
        values = [self._value(fraction, parameter, target, training) for target in listed]
        return Fixed(values[0]) if len(set(values)) == 1 else Choice(tuple(values))

    def _value(self, fraction: float, parameter: Parameter, target: Interval, training: Support) -> Value:
        """Value at a fraction of the path to one target range."""
        period = parameter.period
        ends = [target.low, target.high, *_opposite(training, target, period)]
        far = max(ends, key=lambda v: abs(nearest(training, v, period) - v))
        edge = nearest(training, far, period)
        far = self.limits.get(parameter.name, far)
        value = wrapped(edge + fraction * (far - edge), parameter.low, parameter.high, period)
        if not parameter.integer:
            return value
        if abs(value - round(value)) > 1e-9:
            raise BadConfig(
                f"axis {self.name}: {fraction:.0%} of its path puts {parameter.name} at {value:g}, which must be a "
                f"whole number; from {edge:g} to {far:g} there are {abs(far - edge):g} steps"
            )
        return round(value)


def _opposite(training: Support, target: Interval, period: float | None) -> list[float]:
    """On a circle, the values of a range that lie midway between two neighbouring parts of training."""
    if period is None:
        return []
    parts = sorted((z for part in training for z in turned(part, target, period)), key=lambda i: i.low)
    middles = [(one.high + other.low) / 2 for one, other in itertools.pairwise(parts) if one.high < other.low]
    return [middle for middle in middles if middle in target]


def reflected(support: Support, about: float) -> Support:
    """Mirror image of a support about a value."""
    return tuple(sorted((i.reflected(about) for i in support), key=lambda i: i.low))


def spell(dist: Dist) -> str:
    """The distribution's values in a few words: `0.6 to 1.2` or `{0, 90}`."""
    points = [i.low for i in dist.support if i.low == i.high]
    spans = [_spell(i) for i in dist.support if i.low < i.high]
    return " or ".join([*spans, "{" + ", ".join(f"{p:g}" for p in points) + "}"] if points else spans)


def _spell(span: Interval) -> str:
    """An interval in a few words."""
    open_ends = [e for e, is_open in ((span.low, span.open_low), (span.high, span.open_high)) if is_open]
    without = f" without {' and '.join(f'{e:g}' for e in open_ends)}" if open_ends else ""
    return f"{span.low:g} to {span.high:g}{without}"
