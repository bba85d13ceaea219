"""Judgements of people about the episodes of a recording: the tables of scores and decisions, read and written."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from filelock import FileLock

from ...errors import BadConfig, PoolError, UnknownName, cut
from ...pool.files import replace_file
from ...work.plain import read_plain

SCORES = "scores.csv"
DECISIONS = "decisions.csv"
SCORE_COLUMNS = ("episode", "score")
DECISION_COLUMNS = ("episode", "verdict", "who", "why")
SCORE_TEXTS = ("1", "2", "3", "4", "5")
"""Scores of people."""
ACCEPT = "accept"
"""Verdict that keeps an episode."""
REJECT = "reject"
"""Verdict that keeps an episode out."""
VERDICTS = (ACCEPT, REJECT)
"""Verdicts of people."""
MAX_CSV = 1_000_000
"""Size of the largest table of people that is read [bytes]."""
MAX_DIGITS = 9
"""Number of digits of the largest number of an episode, without leading zeros."""
MAX_WORDS = 500
"""Length of the longest name or reason that is written [characters]."""
LOCK_TIME = 10.0
"""Longest wait for another program that writes the same table [s]."""


@dataclass(frozen=True)
class Decision:
    """Decision of a person about an episode."""

    verdict: str
    who: str
    why: str


def scores_by_people(path: Path, count: int) -> dict[int, int]:
    """Scores of people by episode.

    Raises:
        BadConfig: one line of the table has no meaning.
    """
    found = {}
    for place, row in _table(path, SCORE_COLUMNS, count):
        if row["score"].strip() not in SCORE_TEXTS:
            raise BadConfig(f"{path}, line {place}: score = {cut(row['score'])!r}; it must be 1 to 5")
        score = int(row["score"])
        _check_same(found.setdefault(int(row["episode"]), score), score, path, place)
    return found


def _check_same(before: str | int, now: str | int, path: Path, place: int) -> None:
    """Raise `BadConfig` if two lines of a table contradict each other."""
    if before != now:
        raise BadConfig(f"{path}, line {place}: {now}, an earlier line of this episode says {before}; remove one")


def decisions_of_people(path: Path, count: int) -> dict[int, Decision]:
    """Decisions of people by episode; lines without a verdict are still open.

    Raises:
        BadConfig: one line of the table has no meaning.
    """
    found = {}
    for place, row in _table(path, DECISION_COLUMNS, count):
        verdict = row["verdict"].strip()
        if verdict and verdict not in VERDICTS:
            raise BadConfig(f"{path}, line {place}: verdict = {cut(verdict)!r}; it must be {' or '.join(VERDICTS)}")
        if verdict:
            number = int(row["episode"])
            _check_same(found[number].verdict if number in found else verdict, verdict, path, place)
            found[number] = Decision(verdict, row["who"].strip(), row["why"].strip())
    return found


def _table(path: Path, columns: Sequence[str], count: int) -> list[tuple[int, dict[str, str]]]:
    """Lines of a table with their numbers; none if there is no such file.

    Raises:
        BadConfig: it lacks a column, or names an episode that does not exist.
        PoolError: it cannot be read.
    """
    if not path.exists():
        return []
    try:
        reader = csv.DictReader(io.StringIO(read_plain(path, MAX_CSV).decode(), newline=""))
        rows = [(reader.line_num, {name: str(row.get(name) or "") for name in columns}) for row in reader]
        named = reader.fieldnames or []
    except (OSError, ValueError, csv.Error) as error:
        raise PoolError(f"{path} cannot be read ({' '.join(str(error).split())[:120]}); correct or remove it") from None
    if missing := [name for name in columns if name not in named]:
        raise BadConfig(f"{path} lacks the column {missing[0]}; its first line must be {','.join(columns)}")
    for place, row in rows:
        digits = row["episode"].strip().lstrip("0") or row["episode"].strip()[:1]
        if not (digits.isdecimal() and digits.isascii() and len(digits) <= MAX_DIGITS and int(digits) < count):
            raise BadConfig(f"{path}, line {place}: episode = {cut(row['episode'])!r}; it must be 0 to {count - 1}")
        row["episode"] = digits
    return rows


def write_score(folder: Path, episode: int, score: int, count: int) -> None:
    """Write the score of a person in place of an earlier one, at once.

    Args:
        folder: folder of the tables.
        count: number of episodes of the recording.

    Raises:
        ScengenError: the score has no meaning, or the table cannot be read.
    """
    if score not in range(1, 6):
        raise BadConfig(f"score = {score}; it must be 1 to 5")
    _replace_row(folder / SCORES, SCORE_COLUMNS, {"episode": str(episode), "score": str(score)}, count)


def write_decision(folder: Path, episode: int, decision: Decision, count: int) -> None:
    """Write the decision of a person in place of an earlier one, at once.

    Args:
        folder: folder of the tables.
        count: number of episodes of the recording.

    Raises:
        ScengenError: the verdict has no meaning, a text is too long, or the table cannot be read.
    """
    if decision.verdict not in VERDICTS:
        raise UnknownName("verdict", decision.verdict, VERDICTS)
    for name in ("who", "why"):
        text = getattr(decision, name)
        if len(text) > MAX_WORDS or not text.isprintable():
            raise BadConfig(f"{name} = {cut(ascii(text))}; give one line of at most {MAX_WORDS} characters")
    _replace_row(folder / DECISIONS, DECISION_COLUMNS, {"episode": str(episode), **asdict(decision)}, count)


def _replace_row(path: Path, columns: Sequence[str], row: Mapping[str, str], count: int) -> None:
    """Write a table with one row replaced or added. Programs that write the same table wait for each other."""
    if not 0 <= int(row["episode"]) < count:
        raise BadConfig(f"episode = {row['episode']}; it must be 0 to {count - 1}")
    path.parent.mkdir(exist_ok=True)
    with FileLock(path.with_suffix(".lock"), timeout=LOCK_TIME):
        others = [other for _, other in _table(path, columns, count) if int(other["episode"]) != int(row["episode"])]
        text = io.StringIO()
        writer = csv.DictWriter(text, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted([*others, row], key=lambda each: int(each["episode"])))
        replace_file(path, text.getvalue().encode())
