"""Splits: the distributions that scenarios are drawn from.

Spelled `id`, `wide_gaps`, `wide_gaps@3`, `diagonal+wide_gaps@3`.
"""

from dataclasses import dataclass
from typing import Self

from ..errors import BadConfig
from .task_files import ID as ID


@dataclass(frozen=True)
class Part:
    """One axis of a split."""

    axis: str
    """Name of the axis."""
    severity: int | None = None
    """Severity of the axis; None for the whole axis."""

    def __str__(self) -> str:
        return self.axis if self.severity is None else f"{self.axis}@{self.severity}"

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read `axis` or `axis@3`.

        Raises:
            BadConfig: the severity is not a whole number.
        """
        axis, at, severity = text.partition("@")
        if at and not (severity.isascii() and severity.isdecimal()):
            raise BadConfig(f"split {text}: the severity after @ must be a whole number, as in {axis}@1")
        return cls(axis, int(severity) if at else None)


@dataclass(frozen=True)
class Split:
    """The axes along which scenarios leave training. Without axes it is the training split itself."""

    parts: tuple[Part, ...] = ()
    """Axes of the split with their severities."""

    def __str__(self) -> str:
        return "+".join(self.axes) or ID

    @property
    def axes(self) -> tuple[str, ...]:
        """Spelling of every part."""
        return tuple(map(str, self.parts))

    @property
    def is_training(self) -> bool:
        """Whether this is the training split."""
        return not self.parts

    @classmethod
    def parse(cls, text: "str | Split") -> "Split":
        """Read a split. It does not check whether a task has such axes; the task does.

        Raises:
            BadConfig: a severity is not a whole number, or training is composed with an axis.
        """
        if isinstance(text, Split):
            return text
        names = text.split("+")
        if names == [ID]:
            return cls()
        if ID in names:
            raise BadConfig(f"split {text}: {ID} is training itself; leave it out")
        return cls(tuple(map(Part.parse, names)))
