"""Splits: where scenarios are drawn from. Spelled `id`, `wide_gaps`, `wide_gaps@3`, `diagonal+wide_gaps@3`."""

from dataclasses import dataclass
from typing import Self

from ..errors import BadConfig
from ..task_files import ID as ID


@dataclass(frozen=True)
class Part:
    """One axis of a split."""

    axis: str
    severity: int | None = None
    """Which of the axis' severities; None for the whole axis."""

    def __str__(self) -> str:
        return self.axis if self.severity is None else f"{self.axis}@{self.severity}"

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read `axis` or `axis@3`.

        Raises:
            BadConfig: the severity is no whole number.
        """
        axis, at, severity = text.partition("@")
        if at and not (severity.isascii() and severity.isdecimal()):
            raise BadConfig(f"split {text}: the severity after @ is a whole number, as in {axis}@1")
        return cls(axis, int(severity) if at else None)


@dataclass(frozen=True)
class Split:
    """The axes along which scenarios leave training; without any, the training split itself."""

    parts: tuple[Part, ...] = ()

    def __str__(self) -> str:
        return "+".join(self.axes) or ID

    @property
    def axes(self) -> tuple[str, ...]:
        """Every part as it is spelled."""
        return tuple(map(str, self.parts))

    @property
    def is_training(self) -> bool:
        return not self.parts

    @classmethod
    def parse(cls, text: "str | Split") -> "Split":
        """Read a split. Whether a task has such axes is for the task to say.

        Raises:
            BadConfig: a severity is no whole number, or training is composed with an axis.
        """
        if isinstance(text, Split):
            return text
        names = text.split("+")
        if names == [ID]:
            return cls()
        if ID in names:
            raise BadConfig(f"split {text}: {ID} is training itself; leave it out")
        return cls(tuple(map(Part.parse, names)))
