"""Comparison of a task with its stored behaviour."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from ..errors import Infeasible, contrasted
from ..installation import versions
from ..samplers.split import ID
from ..samplers.task import Task
from ..work.fingerprint import fingerprint
from .behaviour import (
    SEED,
    TRAINING_DRAWS,
    Behaviour,
    Cheat,
    current_rules,
    declared,
    drawn,
    is_core,
    machine,
    oracles,
    rollouts,
    splits,
)
from .edges import Edge
from .rollouts import Stage

Level = Literal["version", "bits", "new"]
"""Weight of a difference. `version`: the task is another one, and its `VERSION` must rise. `bits`: the same verdict
with other bits, and the file must be written again. `new`: the file lacks it, likewise."""
FIRST = f"{ID} 0 "
"""Beginning of the names of the rollouts in the first training draw."""
NOTHING = None
"""Value of what is missing on one side."""


@dataclass(frozen=True)
class Difference:
    """One difference between a task and its stored behaviour."""

    task: str
    kind: str
    """Kind of behaviour, such as `draw`, `scene`, `constraint`, `success or failure`, `events`, `oracle`."""
    what: str
    """Object that differs, such as the name of a split or a rollout."""
    stored: Any
    """Stored value; None if there is none."""
    now: Any
    """Present value; None if there is none."""
    level: Level

    def __str__(self) -> str:
        was, now = contrasted(*("nothing" if value is NOTHING else str(value) for value in (self.stored, self.now)), 80)
        return f"{self.task}: {self.kind}: {self.what}: {was} is now {now}"


@dataclass(frozen=True)
class Compared:
    """Result of a comparison."""

    task: str
    version: int
    """Version of the file."""
    differences: tuple[Difference, ...]
    rollouts: int
    """Number of rollouts that were played."""
    same_machine: bool
    """Whether bits are compared: machine and packages are those with which the file was written."""

    @property
    def reproduces(self) -> str:
        """Part of the behaviour that this machine reproduces: `bits`, `verdicts`, or `no`."""
        levels = {difference.level for difference in self.differences}
        if "version" in levels:
            return "no"
        return "verdicts" if "bits" in levels or not self.same_machine else "bits"


def compare(
    task: Task,
    stored: Behaviour,
    wanted: Callable[[str], bool] = is_core,
    cheats: Mapping[str, Cheat] | None = None,
    every_split: bool = False,
) -> Compared:
    """Compare a task with its stored behaviour.

    Args:
        wanted: rollouts of the first training draw that are played, by name.
        cheats: kept cheats of the task; without them their rollouts are not played.
        every_split: whether the oracle plays in the other stored draws, too.
    """
    found, same = list(without_rollouts(task, stored)), same_machine(stored)
    if (stage := _stage(task, cheats or {})) is None:
        return Compared(task.name, stored.version, tuple(found), 0, same)
    played = {f"{FIRST}{name}": result for name, result in rollouts(stage, wanted).items()}
    if every_split:
        played |= oracles(task)
    found += _rollouts(task.name, stored.rollouts, played, same)
    first = [name for name in stored.rollouts if name.startswith(FIRST) and wanted(name.removeprefix(FIRST))]
    gone = [name for name in first if name not in played and (cheats or " cheat " not in name)]
    found += [Difference(task.name, "rollout", name, stored.rollouts[name][0], NOTHING, "version") for name in gone]
    return Compared(task.name, stored.version, tuple(found), len(played), same)


def _stage(task: Task, cheats: Mapping[str, Cheat]) -> Stage | None:
    """The first training draw; None if it has no feasible scenario."""
    try:
        return Stage(task.draw(ID, SEED, 0).scenario, task.embodiment, task.horizon, cheats)
    except Infeasible:
        return None


def same_machine(stored: Behaviour) -> bool:
    """Whether this machine and its packages give the bits of a file."""
    names = ("mujoco", "robosuite", "numpy")
    made = stored.made["versions"]
    return stored.made["machine"] == machine() and all(made[name] == versions()[name] for name in names)


def without_rollouts(task: Task, stored: Behaviour) -> Iterator[Difference]:
    """Differences of what needs no rollout: declared values, draws, scenes, constraints, rules."""
    found = list(_described(task, stored))
    yield from found
    if any(each.kind == "scene" and each.what == f"{ID} 0" for each in found):
        return  # the stored states belong to another scene
    if stage := _stage(task, {}):
        yield from _rules(task.name, stored, current_rules(stage, stored))


def _described(task: Task, stored: Behaviour) -> Iterator[Difference]:
    """Differences of declared values, draws and constraints."""
    if same_machine(stored) and stored.made["fingerprint"] != fingerprint():
        yield Difference(task.name, "controller", "fingerprint", stored.made["fingerprint"], fingerprint(), "bits")
    if task.version != stored.version:
        yield Difference(task.name, "version", "VERSION", stored.version, task.version, "version")
    yield from _mappings(task.name, "declared value", stored.declared, declared(task), task.axes)
    for split, index in splits(task):
        name = f"{split} {index}"
        now, was = drawn(task, split, index), stored.draws.get(name)
        if was is None:
            yield Difference(task.name, "split", name, NOTHING, "drawn", "new")
            continue
        for part in was.keys() | now.keys():
            if was.get(part) != now.get(part):
                kind = "draw" if part in ("id", "attempt", "infeasible") else part.rstrip("s")
                yield Difference(task.name, kind, name, was.get(part), now.get(part), "version")
    try:
        starts = [task.draw(ID, SEED, index).scenario for index in range(TRAINING_DRAWS)]
    except Infeasible:
        return  # the draws differ, which is said above
    for edge in (Edge.of(plain, stored.reasons) for plain in stored.constraints):
        if (again := edge.again(starts[edge.start])) != edge:
            was, now = (" / ".join("; ".join(s) or "feasible" for s in (e.before, e.after)) for e in (edge, again))
            yield Difference(task.name, "constraint", ", ".join(edge.pairs), was, now, "version")


def _mappings(
    task: str, kind: str, stored: Mapping[str, Any], now: Mapping[str, Any], axes: Mapping[str, Any]
) -> Iterator[Difference]:
    """Differences between declared values. What belongs to a new axis alone is new."""
    for name in [*stored, *(name for name in now if name not in stored)]:
        was, here = stored.get(name, NOTHING), now.get(name, NOTHING)
        if was != here:
            new = was is NOTHING and name.split(" ")[0] in axes
            yield Difference(task, kind, name, was, here, "new" if new else "version")


def _rules(task: str, stored: Behaviour, now: Mapping[str, Any]) -> Iterator[Difference]:
    """Differences of what the rules say in stored states, and around their limits."""
    for number, (was, here) in enumerate(zip(stored.states, now["states"], strict=True)):
        parts = [[now["answers"][k] for k in each["answers"]] for each in (was, here)]
        for part, kind in enumerate(RULES):
            if was["answers"][part] != here["answers"][part]:
                yield Difference(task, kind, f"state {number}", parts[0][part], parts[1][part], "version")
            for how in ("contacts", "swept", "mixed"):
                if was[how][part] != here[how][part]:
                    yield Difference(task, kind, f"state {number}, {how}", was[how][part], here[how][part], "version")
        if was["numbers"] != here["numbers"]:
            yield Difference(task, "events", f"state {number}, numbers", was["numbers"], here["numbers"], "version")
    for was, here in zip(stored.limits, now["limits"], strict=True):
        state, coordinate, magnitude = was[:3]
        if was[5] != here[5]:
            what = f"numbers around {magnitude:g} along {coordinate} in state {state}"
            yield Difference(task, "events", what, was[5], here[5], "version")
        for part, kind in enumerate(RULES):
            parts = [" / ".join(now["answers"][side[part]] for side in limit[3:5]) for limit in (was, here)]
            if parts[0] != parts[1]:
                what = f"limit at {magnitude:g} along {coordinate} in state {state}"
                yield Difference(task, kind, what, parts[0], parts[1], "version")


RULES = ("success or failure", "events")
"""Kinds of answers of the rules, in the order of an answer's two parts."""


def _rollouts(
    task: str, stored: Mapping[str, Sequence[Any]], now: Mapping[str, Sequence[Any]], same: bool
) -> Iterator[Difference]:
    """Differences of verdicts, and of bits if both machines are the same."""
    for name, here in now.items():
        was = stored.get(name)
        kind = name.split(" ", 2)[2].split(" ")[0]
        if was is None:
            yield Difference(task, kind, name, NOTHING, here[0], "new")
        elif was[0] != here[0] and was[-1] != "unsteady":
            yield Difference(task, kind, name, was[0], here[0], "version")
        elif same and list(was[:3]) != list(here[:3]):
            yield Difference(
                task, kind, name, f"{was[0]}, {was[1]:g} s, {was[2]}", f"{here[0]}, {here[1]:g} s, {here[2]}", "bits"
            )


def merged(stored: Behaviour, observed: Behaviour) -> Behaviour:
    """Content of a file after a change that kept every verdict: its states and limits, and the present bits.

    A verdict that rounding decides keeps its mark.
    """
    marks = {name for name, result in stored.rollouts.items() if result[-1] == "unsteady"}
    played = {
        name: [*result[:3], "unsteady"] if name in marks else list(result) for name, result in observed.rollouts.items()
    }
    kept = {
        name: getattr(stored, name) for name in ("reasons", "constraints", "answers", "contacts", "states", "limits")
    }
    return replace(observed, rollouts=played, **kept)
