"""Rollouts of a policy, kept as demonstrations: of each pool in a separate folder, failures included."""

from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ..episode import Actions, check_rules
from ..errors import BadConfig
from ..evaluate.lines import FOLDER, condition_of, kept_folder
from ..evaluate.settings import EvaluateSettings, RolloutId
from ..perturb.perturbation import Perturbation
from ..pool import Pool
from ..pool.demonstrations import DEMONSTRATIONS, POLICY, DemonstrationConfig
from ..pool.files import sha256
from ..pool.row import DemonstrationRow, PoolRow
from ..runs.attempts import reported_write_errors
from ..runs.journal import Journal, Record
from ..samplers.conditions import split_under
from ..samplers.task import Task
from ..validate.impaired import posed
from ..validate.labels import made_with
from ..validate.playable import stored_world
from ..validate.rollout import replay
from ..validate.verify.stored import task_of_manifest
from .generate import FAILED, KEPT, DemosSummary, finish


class Keeper:
    """Keeps the rollouts of an evaluation. Use it in a `with` statement."""

    def __init__(self, settings: EvaluateSettings, tasks: Mapping[str, Task]):
        """
        Args:
            tasks: the installed tasks of the pools.

        Raises:
            ScengenError: two pools have the same name.
        """
        names = [Path(folder).name for folder in settings.folders]
        if twice := {name for name in names if names.count(name) > 1}:
            raise BadConfig(f"several pools are in folders named {twice.pop()}; rename one to keep their episodes")
        self.settings, self._tasks = settings, tasks
        self._kept: dict[Path, _PoolKeeper] = {}
        for folder in settings.every_folder:
            for earlier in sorted(settings.folder.glob(f"{FOLDER}*/{Path(folder).name}")):
                self._keeper(folder, earlier)

    def __call__(self, which: RolloutId, actions: Actions) -> None:
        """Keep the actions of a rollout.

        Raises:
            ScengenError: rollouts of another evaluation are there, or nothing can be written.
        """
        self._keeper(which.pool, kept_folder(self.settings.folder, which)).add(which, actions)

    def _keeper(self, pool: str, folder: Path) -> "_PoolKeeper":
        """The keeper that writes a folder."""
        if folder not in self._kept:
            opened = Pool.open(pool)
            task = task_of_manifest(opened, self._tasks[opened.task])
            self._kept[folder] = _PoolKeeper(opened, task, self.settings, folder)
        return self._kept[folder]

    def finish(self) -> list[DemosSummary]:
        """Write the folders of all pools, and return what they hold."""
        return [keeper.finish() for keeper in self._kept.values()]

    def close(self) -> None:
        """Close the journals."""
        for keeper in self._kept.values():
            keeper.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class _PoolKeeper:
    """Keeps the rollouts on one pool."""

    def __init__(self, pool: Pool, task: Task, settings: EvaluateSettings, folder: Path):
        self.pool, self.task, self.settings, self.folder = pool, task, settings, folder
        about, condition = pool.manifest.config, condition_of(folder)
        self.driver: dict[str, Any] = {"policy": settings.name}
        """Entries of the manifest about the policy."""
        if condition:
            self.driver |= {"condition": str(condition), "perturb_seed": settings.perturb_seed}
        self.conditions = Perturbation.parse(condition.perturbation).conditions(task.embodiment)
        """Conditions of control under which the scenarios of the pool are posed."""
        self.config = DemonstrationConfig(
            task=about.task,
            split=str(split_under(about.split, self.conditions)),
            sampler=about.sampler,
            seed=about.seed,
            runs=settings.rollouts,
            styles=(POLICY,),
            keep=(FAILED,),
            settle=about.certify["settle"],
            apart=(),
            rules=settings.rules,
        )

    @cached_property
    def journal(self) -> Journal:
        """The journal, opened by the first rollout."""
        names = ("version", "observations", "width", "height", "action_filter", "action_repeat", "client")
        identity = {**self.driver, **{name: getattr(self.settings, name) for name in names}}
        made = {"pool": self.pool.sha256, "config": asdict(self.config), **identity, **made_with(self.task)}
        return Journal(self.folder, made, DEMONSTRATIONS, DemonstrationRow, "to")

    def close(self) -> None:
        """Close the journal, if it is open."""
        if "journal" in vars(self):
            self.journal.close()

    @cached_property
    def _places(self) -> Mapping[str, int]:
        return {id_: place for place, (id_,) in enumerate(self.pool.columns("id"))}

    def add(self, which: RolloutId, actions: Actions) -> None:
        """Play the actions again, and store what they do."""
        row = self._posed(self.pool.at(self._places[which.scenario]))
        scenario = self.task.scenario(row.params, row.split)
        rules = check_rules(self.config.rules)
        played = replay(scenario, stored_world(row), actions, row.horizon, self.config.settle, rules=rules)
        columns = {name: value for name, value in vars(row).items() if name != "certificate"}
        kept = DemonstrationRow(
            **{**columns, "witness": played.actions, "witness_sha256": sha256(played.actions.tobytes())},
            run=which.rollout,
            style=POLICY,
            outcome=played.outcome,
            reason=played.reason,
            seconds=played.seconds,
            final_state=played.digest,
        )
        index = row.index * self.settings.rollouts + which.rollout
        told = (KEPT, "", "") if played.solved else (FAILED, "solved", f"{played.outcome}: {played.reason}")
        self.journal.add(Record(index, *told, 1, {}, kept, 0.0))

    def _posed(self, row: PoolRow) -> PoolRow:
        """A row of the pool under the conditions of control: the row of the split that names them."""
        if self.conditions is None:
            return row
        split = split_under(row.split, self.conditions)
        scenario = self.task.scenario(row.params, split)
        text = posed(row.scene_xml, self.conditions, row.id)
        labels = {"id": scenario.id, "split": str(split), "axes": split.axes}
        return replace(row, **labels, scene_xml=text, scene_sha256=sha256(text))

    def finish(self) -> DemosSummary:
        """Write the rollouts that were kept."""
        records = self.journal.records()
        with reported_write_errors(self.folder):
            return finish(self.folder, self.task, self.config, len(records), records, self.journal, **self.driver)
