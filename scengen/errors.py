"""Errors that a user can act on. Each message says what was given, what is accepted, and the nearest known name.

`place_of` finds out whose code an error comes from.
"""

import difflib
import inspect
import traceback
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any


class ScengenError(Exception):
    """Base class of every error that scengen raises on purpose. Its message, class and attributes survive pickling."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self), self.args, self.__dict__)


def _restored(kind: type[ScengenError], args: tuple[Any, ...], state: Mapping[str, Any]) -> ScengenError:
    """An error as it was, without its constructor, which makes the message of other arguments."""
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class BadConfig(ScengenError):
    """A configuration contradicts itself or its scenario class."""


class OutOfBounds(ScengenError):
    """A parameter lies outside the range in which its scenario has a physical meaning."""

    def __init__(self, where: str, value: object, low: float, high: float, unit: str):
        super().__init__(f"{where} = {value} {unit}; it must lie in [{low:g}, {high:g}] {unit}")


class UnknownName(ScengenError):
    """A requested name does not exist. The message lists the names that do."""

    def __init__(
        self, kind: str, name: str, known: Iterable[str], meant: str | None = None, others: Iterable[str] = ()
    ):
        """
        Args:
            meant: the known name that is meant, if its spelling is far from the given one.
            others: further unknown names.
        """
        names = sorted({*known})
        close = f" (did you mean {meant!r}?)" if meant else nearest(name, names)
        also = "".join(f", nor {cut(repr(other))}{nearest(other, names)}" for other in others)
        remedy = f"; {REMEDIES[kind]}" if kind in REMEDIES else ""
        is_clear = close and all(nearest(other, names) for other in others)
        listed = "" if is_clear and len(names) > MANY else f"; known: {', '.join(names) or '(none)'}"
        super().__init__(f"no {kind} named {cut(repr(name))}{close}{also}{remedy}{listed}")


MANY = 24
"""Number of known names above which a message does not list them, if it names the nearest one."""


REMEDIES = {
    "task": "scengen tasks lists them, hydra.searchpath=FOLDER adds the folder that holds your task/NAME.yaml",
    "split in these pools": "scengen generate split=NAME makes a pool of another split",
    "certify": "hydra.searchpath=FOLDER adds the folder that holds your certify/NAME.yaml",
}
"""Remedies for unknown names, by kind."""


class Infeasible(ScengenError):
    """No draw satisfied the scenario's own constraints."""

    def __init__(self, where: str, tries: int, reasons: Mapping[str, int]):
        self.tries, self.reasons = tries, dict(reasons)
        text = "; ".join(f"{n}x {reason}" for reason, n in sorted(reasons.items(), key=lambda x: -x[1]))
        super().__init__(f"{where}: none of {tries} draws was feasible ({text}); widen the distributions")


class NoRobot(ScengenError):
    """The robot's files are missing, or are not those of robosuite's release."""


class PoolError(ScengenError):
    """A pool is missing, damaged or locked, or does not belong to the run that wants to write it."""


class OtherVersions(PoolError):
    """A pool was certified with a MuJoCo or robosuite that is not installed, so that nothing can be judged here."""


class Unstable(ScengenError):
    """MuJoCo raised a warning, so that nothing simulated after it is valid."""


class NoEvent(ScengenError):
    """Code outside a scenario's `events` tried to change something that only events may change."""

    def __init__(self, what: str):
        super().__init__(f"{what} outside of events; only Scenario.events may do that, called by Episode.begin")


class NoOracle(ScengenError):
    """The requested oracle does not exist: the family has no scripted solution."""

    def __init__(self, family: str):
        super().__init__(f"{family} has no oracle; write its method oracle(world), see CONTRIBUTING.md")


class GaveUp(ScengenError):
    """A move did not reach its end condition in time."""


class ForeignCode(ScengenError):
    """Code outside scengen, such as a policy, raised an exception, which is the cause of this error."""


SHOWN_LENGTH = 200
"""Length up to which an error repeats a given value [characters]."""


def cut(text: str, most: int = SHOWN_LENGTH) -> str:
    """The first `most` characters of a text, with `...` if it is longer."""
    return text if len(text) <= most else f"{text[:most]}..."


def contrasted(one: str, other: str, most: int = 60) -> tuple[str, str]:
    """Two texts that differ, cut where they agree: at most `most` characters of each, with their first difference."""
    pairs, shorter = enumerate(zip(one, other, strict=False)), min(len(one), len(other))
    first = next((place for place, (a, b) in pairs if a != b), shorter)
    begin = max(0, first - most // 3) if max(len(one), len(other)) > most else 0

    def shown(text: str) -> str:
        return f"{'...' if begin else ''}{cut(text[begin:], most)}"

    return shown(one), shown(other)


def nearest(name: str, known: Iterable[str]) -> str:
    """The clause ` (did you mean 'x'?)`, or an empty text if no known name is close."""
    close = difflib.get_close_matches(name, list(known), n=1, cutoff=0.6) if len(name) <= SHOWN_LENGTH else []
    return f" (did you mean {close[0]!r}?)" if close else ""


PLACE = "_scengen_place"
"""Attribute of an error that holds `place_of` in the process where it was raised: tracebacks stay there."""


def with_place(error: Exception) -> Exception:
    """An error that can be sent to another process without losing the place from which it comes."""
    setattr(error, PLACE, place_of(error))
    return error


def place_of(error: BaseException) -> str:
    """The last place in code that is not scengen's through which an error came, such as `task.py, line 3, in success`.

    Returns:
        The place; empty if only scengen, its dependencies and Python were involved.
    """
    if (place := getattr(error, PLACE, None)) is not None:
        return place
    if isinstance(error, SyntaxError) and error.filename and _is_foreign(error.filename, ""):
        return f"{shown(error.filename)}, line {error.lineno}"
    for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
        if _is_foreign(frame.f_code.co_filename, _package(frame)):
            return f"{shown(frame.f_code.co_filename)}, line {line}, in {frame.f_code.co_name}"
    return ""


def where_written(code: Callable[..., Any]) -> str:
    """The place of the first line of a function, such as `task.py, line 3, in build`."""
    written = inspect.unwrap(code).__code__
    return f"{shown(written.co_filename)}, line {written.co_firstlineno}, in {written.co_name}"


def _package(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", "")).partition(".")[0]


@cache
def _is_foreign(file: str, package: str) -> bool:
    """Whether a file is neither scengen's nor that of Python or of an installed package that does not build on it."""
    import sysconfig

    path, installed = Path(file), sysconfig.get_paths()
    if not path.is_file() or path.is_relative_to(Path(__file__).parent):
        return False
    if path.is_relative_to(installed["purelib"]) or path.is_relative_to(installed["platlib"]):
        return _builds_on_scengen(package)
    return not (path.is_relative_to(installed["stdlib"]) or path.is_relative_to(installed["platstdlib"]))


def _builds_on_scengen(package: str) -> bool:
    """Whether the distribution of a package requires scengen, as one with tasks does."""
    from importlib import metadata  # here, because it takes 20 ms

    names = metadata.packages_distributions().get(package, [])
    required = [line for name in names for line in metadata.requires(name) or []]
    return any(line.split(";")[0].strip().startswith("scengen") for line in required)


def shown(file: str | Path) -> str:
    """A file relative to the working directory if it is in it."""
    path = Path(file)
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
