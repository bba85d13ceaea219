"""Other wordings of a task's instruction, from `conf/language`, and what each kind of perturbation makes of them; and
what no words are about: bodies whose look may change, from `conf/things`."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import SequenceMatcher
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadConfig, cut
from ..samplers import task_files
from ..work.plain import read_yaml

WORDINGS = ("reworded", "terse", "vague", "foreign")
"""Kinds that replace the instruction by a text of `conf/language/<task>.yaml`."""
CLAUSES = ("verbose", "distracting")
"""Kinds that add sentences of `conf/language/clauses.yaml`."""
NO_WORDINGS = f"{{0}} has no other wordings; write {', '.join(WORDINGS)} to conf/language/{{0}}.yaml"
"""Why a wording of a task cannot be given, with the task's name to be filled in."""
TEXTS = 5
"""Number of texts of each wording."""
MAX_TEXT = 400
"""Length of the longest text [characters]."""


@dataclass(frozen=True)
class Words:
    """The instruction of a task and what may be said instead."""

    task: str
    """Name of the task."""
    instruction: str
    wordings: Mapping[str, Sequence[str]] = field(default_factory=dict[str, Sequence[str]])
    """Texts of each kind in `WORDINGS`."""
    free: tuple[str, ...] = ()
    """Patterns of the names of bodies whose look no text, rule or goal depends on."""

    @classmethod
    def of(cls, task: str, instruction: str, search: Sequence[str] = ()) -> "Words":
        """The words of a task, without wordings or free bodies if no file has them.

        Raises:
            BadConfig: the file is damaged, or has the instruction itself.
        """
        path, things = (task_files.file_of_group(task, group, search) for group in ("language", "things"))
        found = wordings(path) if path else {}
        for name, texts in found.items():
            if instruction in texts:
                raise BadConfig(f"{path}: {name} has the instruction of the task itself; give other words")
        return cls(task, instruction, found, free_bodies(things) if things else ())


@cache
def free_bodies(path: Path) -> tuple[str, ...]:
    """The patterns in a file of a task.

    Raises:
        BadConfig: it holds anything but a list of names, `bodies`.
    """
    node = read_yaml("bodies", path)
    names = node.get("bodies") if {*node} == {"bodies"} else node
    if not isinstance(names, list) or not all(isinstance(name, str) and 0 < len(name) <= MAX_TEXT for name in names):
        raise BadConfig(
            f"{path}: {cut(repr(names))}; give names of bodies, such as `bodies: [box, tile_*]`, and nothing else"
        )
    return tuple(names)


@cache
def wordings(path: Path) -> Mapping[str, Sequence[str]]:
    """The texts in a file of a task.

    Raises:
        BadConfig: it has other keys, another number of texts, equal texts, or a text of several lines.
    """
    node = read_yaml("texts", path)
    if not isinstance(node, Mapping) or {*node} != {*WORDINGS}:
        raise BadConfig(f"{path}: give {', '.join(WORDINGS)}, each with {TEXTS} texts")
    found = {name: tuple(_line(path, each) for each in _list(path, name, node[name])) for name in WORDINGS}
    for name, texts in found.items():
        if len({*texts}) != TEXTS:
            raise BadConfig(f"{path}: {name} has {len({*texts})} different texts; give {TEXTS}")
    return found


def _list(path: Path, name: str, value: Any) -> list[Any]:
    if not isinstance(value, list) or not value:
        raise BadConfig(f"{path}: {name} = {cut(repr(value))}; give a list of texts")
    return value


def _line(path: Path, text: Any) -> str:
    if not isinstance(text, str) or not text.strip() or len(text) > MAX_TEXT or not text.isprintable():
        raise BadConfig(f"{path}: {cut(repr(text))}; give a text of one line and at most {MAX_TEXT} characters")
    return text


def worded(kind: str, number: int, words: Words) -> str:
    """A text that replaces the instruction.

    Args:
        number: which text, from 1.

    Raises:
        BadConfig: the task has none.
    """
    if not words.wordings:
        raise BadConfig(f"{kind}: {NO_WORDINGS.format(words.task)}")
    return words.wordings[kind][number - 1]


def extended(kind: str, number: int, key: int, text: str) -> str:
    """A text with some sentences around it; with more of them the others stay.

    Args:
        number: number of sentences.
        key: seed of the choice.
    """
    before, after = clauses(kind)
    every = [(True, each) for each in before] + [(False, each) for each in after]
    chosen = [every[place] for place in np.random.default_rng(key).permutation(len(every)).tolist()]
    first, *_ = [each for starts, each in chosen if starts] or [""]
    others = [each for starts, each in chosen if not starts]
    if not first:
        return " ".join([text, *others[:number]])
    joined = f"{first} {text[0].lower()}{text[1:]}" if first.endswith(",") else f"{first} {text}"
    return " ".join([joined, *others[: number - 1]])


@cache
def clauses(kind: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Beginnings and sentences that a kind adds to any instruction, from `conf/language/clauses.yaml`."""
    path = task_files.conf_dir() / "language" / "clauses.yaml"
    node = read_yaml("clauses", path)[kind]
    parts = node if isinstance(node, Mapping) else {"before": [], "after": node}
    return tuple(map(str, parts["before"])), tuple(map(str, parts["after"]))


def leaks(text: str, instruction: str, names: Iterable[str]) -> list[str]:
    """Which of some names a text has as words and the instruction has not."""

    def said(name: str, where: str) -> bool:
        words = re.escape(re.sub(r"[._]", " ", name))
        return re.search(rf"\b{words}\b", re.sub(r"[._]", " ", where), re.I) is not None

    return sorted(name for name in names if said(name, text) and not said(name, instruction))


def other_words(text: str, instruction: str) -> float:
    """Share of words in which a text differs from the instruction, from 0 to 1."""
    one, two = (re.findall(r"\w+", each.lower()) for each in (instruction, text))
    return 1.0 - SequenceMatcher(None, one, two, autojunk=False).ratio()
