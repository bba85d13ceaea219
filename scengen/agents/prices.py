"""Prices of models: what a run costs, in the currency in which they are given."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import BadConfig, UnknownName, cut
from ..work.plain import read_yaml

WANTED = (
    "give two numbers from 0 on, the prices of a million tokens of prompts and of answers, or a file: MODEL: [3, 15]"
)


@dataclass(frozen=True)
class Prices:
    """Prices of one model, and what a run may cost."""

    prompt: float
    """Price of a million tokens of prompts."""
    answer: float
    """Price of a million tokens of answers."""
    most: float | None = None
    """Cost at which a run stops; no limit by default."""

    def of(self, tokens: tuple[int, int]) -> float:
        """The cost of some tokens of prompts and answers."""
        return (self.prompt * tokens[0] + self.answer * tokens[1]) / 1e6


def prices(given: str | Sequence[float] | None, model: str, most: float | None) -> Prices | None:
    """The prices of a model; None if they are not given.

    Args:
        given: two numbers, or a YAML file with two numbers for each model.

    Raises:
        BadConfig, UnknownName: they are not valid, or not in the file, or there is a limit without them.
    """
    if most is not None and not 0 <= most < float("inf"):
        raise BadConfig(f"max_cost = {most:g}; it must be a number from 0 on")
    if most is not None and given is None:
        raise BadConfig(f"max_cost = {most:g} needs prices; give prices=[PROMPT,ANSWER] or prices=FILE")
    if given is None:
        return None
    two: Any = _of_file(given, model) if isinstance(given, str) else given
    if not isinstance(two, (list, tuple)) or len(two) != 2 or not all(_is_price(each) for each in two):
        raise BadConfig(f"prices = {cut(str(given))}; {WANTED}")
    return Prices(float(two[0]), float(two[1]), most)


def _of_file(path: str, model: str) -> Any:
    known: Mapping[str, Any] = read_yaml("prices", Path(path))
    if model not in known:
        raise UnknownName(f"model in {cut(path)}", model, known)
    return known[model]


def _is_price(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and 0 <= value < 1e12
