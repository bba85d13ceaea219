"""A run of takes: scenarios in the order of their indices, each driven until solved, written as demonstrations."""

import itertools
import json
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from ...episode import STRICT, check_rules
from ...errors import BadConfig, Infeasible, cut
from ...pool import Pool
from ...pool.demonstrations import DEMONSTRATIONS, OPERATOR, TELEOP, DemonstrationConfig
from ...pool.row import DemonstrationRow
from ...runs.attempts import infeasible
from ...runs.journal import Journal, Record
from ...samplers.split import ID
from ...samplers.task import Draw, Task
from ...validate.certify import Trial
from ...validate.labels import made_with
from ...validate.settings import CertifySettings
from ...work.limits import at_least, check_count
from ...work.targets import write
from ..generate import FAILED, GIVEN_UP, KEPT, DemosSummary, finish, first_failed, row_of
from .devices import kind_of
from .pad import line_of
from .session import Session, Stage

SEED = 2000
"""Default seed. Pools have 0 and scripted demonstrations 1000, so that all three have different scenarios."""
LOGS = "raw"
"""Folder of the logs of all takes, below that of the demonstrations."""
MAX_LOST = 100
"""Number of scenarios in a row that cannot be driven at which a run ends."""


@dataclass(frozen=True)
class TeleopSettings:
    """Settings of `scengen demos pad`; conf/command/demos_pad.yaml explains them."""

    pool: str | None = None
    id: str | None = None
    split: str = ID
    sampler: str = "iid"
    seed: int = SEED
    index: int = 0
    n: int = 10
    takes: int = 10
    limit: int | None = None
    rules: str = STRICT
    device: str = "gamepad"
    operator: str = "op0"
    to: str | None = None
    view: bool | None = None
    camera: str | None = None
    width: int = 640
    height: int = 480

    def check(self) -> None:
        """Raise `ScengenError` for settings that are not valid."""
        check_rules(self.rules)
        at_least(self, seed=0, index=0, n=1, limit=1, width=64, height=64)
        check_count(self.n, self.limit, None, "", "demonstrations")
        if not 1 <= self.takes <= 1000:
            raise BadConfig(f"takes = {self.takes}; it must lie in [1, 1000]")
        if not re.fullmatch(OPERATOR, self.operator):
            raise BadConfig(f"operator = {cut(self.operator)}; give a code such as op7, not a name")


@dataclass(frozen=True)
class Source:
    """Scenarios to drive."""

    task: Task
    split: str
    sampler: str
    seed: int
    indices: Sequence[int] | itertools.count
    """Indices of the scenarios, in their order."""
    certify_settings: CertifySettings

    @classmethod
    def of_task(cls, task: Task, certify_settings: CertifySettings, settings: TeleopSettings) -> "Source":
        """Scenarios that are drawn from a task, and not certified."""
        task.shifts(settings.split)
        task.design(settings.sampler)
        indices = itertools.count(settings.index)
        return cls(task, settings.split, settings.sampler, settings.seed, indices, certify_settings)

    @classmethod
    def of_pool(cls, pool: Pool, task: Task, certify_settings: CertifySettings, id: str | None) -> "Source":
        """Scenarios of a pool, or one of them. They are drawn again: nothing of its files is simulated.

        Raises:
            ScengenError: it holds no such scenario.
        """
        indices = [pool.row(id).index] if id else [index for (index,) in pool.columns("index")]
        config = pool.manifest.config
        return cls(task, str(pool.split), config.sampler, config.seed, indices, certify_settings)

    def draw(self, index: int) -> Draw:
        """The scenario of an index.

        Raises:
            Infeasible: it has none.
        """
        return self.task.draw(self.split, self.seed, index, self.task.design(self.sampler))


@dataclass(frozen=True)
class Place:
    """Place of a take in a run."""

    draw: Draw
    stage: Stage
    take: int
    """Number of the take of its scenario, from 0."""
    number: int
    """Number of the attempt in the run."""


class Run:
    """A run of takes with its journal. Close it at the end."""

    def __init__(self, source: Source, settings: TeleopSettings, told: Callable[[str], None] = lambda text: None):
        """Start a run, or continue one with the same settings.

        Args:
            told: called with lines for the person.

        Raises:
            ScengenError: the folder cannot be written, or belongs to another run.
        """
        settings.check()
        self.source, self.settings, self.told = source, settings, told
        task = source.task
        self.folder = Path(settings.to or Path("generated", f"{task.name}-{source.split}-{TELEOP}-{settings.operator}"))
        self.config = DemonstrationConfig(
            task={"name": task.name, **task.node},
            split=source.split,
            sampler=source.sampler,
            seed=source.seed,
            runs=settings.takes,
            styles=(TELEOP,),
            keep=(FAILED,),
            settle=source.certify_settings.settle,
            apart=(),
            rules=settings.rules,
        )
        checks, operator = asdict(source.certify_settings), settings.operator
        identity = {"config": asdict(self.config), "checks": checks, "operator": operator, **made_with(task)}
        self._journal = Journal(self.folder, identity, DEMONSTRATIONS, DemonstrationRow, "to")
        try:
            self.records = self._journal.records()
        except BaseException:
            self._journal.close()
            raise

    def close(self) -> None:
        self._journal.close()

    @property
    def made(self) -> int:
        """Number of demonstrations so far."""
        return sum(record.verdict == KEPT for record in self.records.values())

    def places(self) -> Iterator[Place]:
        """The takes that are still to be driven. `add` the result of each before asking for the next one.

        Raises:
            BadConfig: many scenarios in a row cannot be driven.
        """
        lost, left = 0, self.settings.limit or 20 * self.settings.n
        for index in self.source.indices:
            if self.made >= self.settings.n:
                return
            first = index * self.settings.takes
            done = [self.records[k] for k in range(first, first + self.settings.takes) if k in self.records]
            if any(record.verdict == KEPT or record.check != "solved" for record in done):
                continue
            found = self._stage(index)
            if found is None:
                lost += 1
                if lost >= MAX_LOST:
                    why = f"{MAX_LOST} scenarios in a row cannot be driven"
                    raise BadConfig(f"{why}; scengen generate prints the reasons, choose another task or split")
                continue
            lost = 0
            for take in range(len(done), self.settings.takes):
                left -= 1
                if left < 0:
                    return
                yield Place(*found, take, first + take)
                if self.records[first + take].verdict == KEPT:
                    break

    def _stage(self, index: int) -> tuple[Draw, Stage] | None:
        """A scenario that passes the cheap checks of a certificate. Others are counted."""
        first, source = index * self.settings.takes, self.source
        try:
            draw = source.draw(index)
        except Infeasible as error:
            self._add(infeasible(first, FAILED, error))
            return None
        task = source.task
        trial = Trial(draw.scenario, task.horizon, source.certify_settings, task.embodiment, None)
        if check := first_failed(trial):
            tries, rejected = draw.attempt + 1, dict(draw.rejected)
            self._add(Record(first, FAILED, check.name, check.reason, tries, rejected, None, 0.0))
            return None
        name, settle = f"{task.name}/{draw.split}@{index}/{draw.scenario.id}", source.certify_settings.settle
        rules = check_rules(self.settings.rules)
        return draw, Stage(name, draw.scenario, trial.text, task.embodiment, task.horizon, settle, rules)

    def add(self, place: Place, session: Session) -> None:
        """Store a finished take: its log, and its actions unless it was given up.

        Raises:
            ScengenError: it does not replay bit for bit, or cannot be written.
        """
        draw, task = place.draw, self.source.task
        tries, rejected = draw.attempt + 1, dict(draw.rejected)
        if session.given_up:
            row, end = None, {"outcome": GIVEN_UP, "periods": len(session.actions)}
            record = Record(place.number, FAILED, "solved", GIVEN_UP, tries, rejected, None, 0.0)
            told = GIVEN_UP
        else:
            played = session.replayed()
            row = row_of(task, draw, session.stage.scene_xml, place.take, TELEOP, played)
            ended = f"{played.outcome}: {played.reason}" if played.reason else played.outcome
            reason = "" if played.solved else ended
            verdict, check = (KEPT, "") if played.solved else (FAILED, "solved")
            record = Record(place.number, verdict, check, reason, tries, rejected, row, 0.0)
            end = {
                name: getattr(row, name) for name in ("outcome", "reason", "seconds", "witness_sha256", "final_state")
            }
            told = f"{ended} after {played.seconds:.2f} s"
        self._write_log(place, session, end)
        self._add(record)
        self.told(f"{place.stage.name}, take {place.take}: {told}; {self.made} of {self.settings.n}")
        if record.verdict == KEPT:
            self.write()

    def write(self) -> DemosSummary:
        """Write the demonstrations so far."""
        settings = self.settings
        return finish(
            self.folder,
            self.source.task,
            self.config,
            settings.n,
            self.records,
            self._journal,
            operator=settings.operator,
        )

    def _add(self, record: Record) -> None:
        self._journal.add(record)
        self.records[record.index] = record.light()

    def _write_log(self, place: Place, session: Session, end: dict[str, object]) -> None:
        """Write the events of a take, with lines before and after them that say what was driven and how it ended."""
        begin = {
            "scenario": place.stage.name,
            "seed": self.source.seed,
            "take": place.take,
            "operator": self.settings.operator,
            "device": kind_of(self.settings.device),
            "ended": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        }
        events = [line_of(tick, event) for tick, event in session.log]
        lines = [json.dumps(begin), *events, json.dumps({**end, "undone": session.undone, "ticks": session.ticks})]
        name = f"{place.draw.index:05d}-{place.take:02d}.jsonl"
        write(self.folder / LOGS / name, "".join(f"{line}\n" for line in lines))
