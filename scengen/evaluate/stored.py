"""The files of an evaluation as data of unknown origin: their entries, and what they must not contradict."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ..errors import BadConfig, ScengenError, cut
from ..pool.untrusted import read_json
from ..work.log import different
from ..work.plain import MAX_JOURNAL, read_plain
from ..work.typed import typed
from .comparison import TABLE
from .lines import FORMAT, RUN
from .policies import BUILT_IN, REPLAY
from .settings import EvaluateSettings
from .threshold.settings import NAMES, ThresholdSettings

OWN = {"observations": None, "action_repeat": 1}
"""Settings that a policy may decide itself, with the value of the settings then."""


@dataclass(frozen=True)
class StoredRun:
    """The settings of a run in `run.json`."""

    format: int
    policy: str
    version: str | None
    observations: list[str] | None
    width: int
    height: int
    action_filter: str | None
    action_repeat: int
    rules: str
    look: str | None
    look_version: int | None
    perturb_seed: int
    pools: Mapping[str, str]
    """Hashes of the pools by their folders."""
    task_versions: Mapping[str, int]
    observed: Mapping[str, list[str]]
    """Names of the streams and cameras that the policy observed, by task."""
    code: Mapping[str, str] = field(default_factory=dict)
    """Hashes of the policy, by task."""
    server: Mapping[str, Any] = field(default_factory=dict)
    """Descriptions that a policy server gave of itself, by task."""
    client: Mapping[str, Any] | None = None
    settle: bool = True
    keep: list[str] = field(default_factory=list)
    harness: str | None = None
    threshold: Mapping[str, Any] = field(default_factory=dict)
    """Settings that decide which rollouts a search for a threshold plays; empty for an evaluation."""

    @classmethod
    def of(cls, plain: Mapping[str, Any], path: Path) -> "StoredRun":
        """The settings of plain data.

        Raises:
            ScengenError: an entry is missing, unknown or of another type, or the format is another one.
        """
        if (given := plain.get("format")) != FORMAT:
            raise BadConfig(f"{path} has format {cut(repr(given), 20)}; this version reads {FORMAT}")
        return typed(str(path), cls, plain)

    def contradictions(self, table: EvaluateSettings) -> Iterator[str]:
        """Settings that are not those of the table.

        Args:
            table: settings of the table.
        """
        own = OWN if self.policy not in (*BUILT_IN, REPLAY) else {}
        for name in sorted({f.name for f in fields(self)} & {*vars(table)} - {"client", "format"}):
            there, here = getattr(table, name), getattr(self, name)
            if there != here and not (name in own and there == own[name]):
                yield f"{TABLE} says {name} = {there!r:.60}, {RUN} has {here!r:.60}"
        design = dict(table.design) if isinstance(table, ThresholdSettings) else {}
        for name in different(design, dict(self.threshold)):
            there, here = design.get(name, "nothing"), self.threshold.get(name, "nothing")
            yield f"{TABLE} is of a search with {name} = {there!r:.60}, {RUN} of one with {here!r:.60}"


@dataclass(frozen=True)
class StoredResult:
    """The entries of a policy in `table.json` that are not figures. The others are computed again from the lines."""

    folder: str
    """Folder of the episodes, from that of the table."""
    settings: Mapping[str, Any]
    episodes_sha256: str
    lost: Mapping[str, str]
    arms: list[str]
    benign: Mapping[str, str]
    drawn: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, plain: Any, path: Path) -> "StoredResult":
        """The entries of plain data.

        Raises:
            ScengenError: an entry is missing or of another type, or the folder lies outside that of the table.
        """
        if not isinstance(plain, Mapping) or "settings" not in plain:
            raise BadConfig(f"{path} is of an earlier release, whose lines cannot be rebuilt; evaluate again")
        found = typed(str(path), cls, {f.name: plain[f.name] for f in fields(cls) if f.name in plain})
        if found.folder != "." and found.folder not in {each.name for each in path.parent.iterdir()}:
            raise BadConfig(
                f"{path} needs the folder {cut(found.folder)!a} next to it, and it is missing; "
                "give a folder of scengen evaluate"
            )
        return found

    def chosen(self, folder: Path) -> EvaluateSettings:
        """The settings of the evaluation.

        Args:
            folder: folder of the table.

        Raises:
            BadConfig: they are none with which anything can be evaluated.
        """
        try:
            kind = ThresholdSettings if NAMES & self.settings.keys() else EvaluateSettings
            found = typed("settings", kind, {**self.settings, "to": str(folder / self.folder)})
            found.check()
        except ScengenError as error:
            raise BadConfig(f"{folder / TABLE}: {error}; give a folder that scengen evaluate wrote") from None
        return found


def stored_results(folder: Path) -> tuple[dict[str, Any], list[StoredResult]]:
    """Content of the table in a folder of results, and the entries of each policy.

    Raises:
        BadConfig: it cannot be read, or is not that of an evaluation.
    """
    stored, path = mapping_in(folder / TABLE), folder / TABLE
    every = stored.get("policies", [stored])
    if not isinstance(every, Sequence) or not every:
        raise BadConfig(f"{path} names no policy; give a folder that scengen evaluate wrote")
    found = [StoredResult.of(each, path) for each in every]
    if len({each.folder for each in found}) < len(found):
        raise BadConfig(f"{path} has two policies in one folder; give a folder that scengen evaluate wrote")
    return stored, found


def mapping_in(path: Path) -> dict[str, Any]:
    """Content of a file of results.

    Raises:
        BadConfig: it cannot be read, or holds something else.
    """
    try:
        found = read_json(read_plain(path, MAX_JOURNAL).decode(), MAX_JOURNAL)
    except (ValueError, OSError) as error:
        why = " ".join(str(error).split())[:160]
        raise BadConfig(f"{path} cannot be read: {why}; give a folder that scengen evaluate wrote") from None
    if not isinstance(found, dict):
        raise BadConfig(f"{path} is not a mapping; give a folder that scengen evaluate wrote")
    return found
