"""Evidence of an attack: hits that replay bit for bit, what they lack, and rates with bounds."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..episode import Actions
from ..errors import BadConfig, NoOracle
from ..sim.world import World
from ..validate.certify import lower_bound
from ..validate.rollout import Jitter, replay, run
from ..validate.settings import Robust
from .play import SETTLE, Arena, Attempt, Node, Played
from .signature import Pair, pairs

VARIED = 3
"""Jittered runs of the oracle: a contact that is missing in one of them is no part of the solution."""


@dataclass(frozen=True)
class Hit:
    """A rollout of the adversary that reached the goal, and does so again in a fresh world, bit for bit."""

    scenario: str
    """Its id."""
    tier: str
    raw: bool
    """Whether its actions came to the controller without the teleoperation filter."""
    plan: str
    """In words."""
    seconds: float
    """When the goal was reached [s]."""
    digest: str
    """Hash of the final physics state."""
    lacks: tuple[Pair, ...]
    """Causal contacts of the witness that it does without."""
    unmoved: tuple[str, ...]
    """Bodies that the witness moves, and it does not."""
    actions: Actions = field(repr=False, compare=False)

    @property
    def refutes(self) -> bool:
        """Whether it shows a way around what the task is about; else it counts as accessibility."""
        return bool(self.lacks)

    @property
    def name(self) -> str:
        """Of its files."""
        return f"{self.scenario}-{self.tier}-{'raw' if self.raw else 'filtered'}-{self.digest[:6]}"

    def __str__(self) -> str:
        without = ", ".join(f"{one} - {other}" for one, other in self.lacks)
        kind = "raw" if self.raw else "filtered"
        return f"without {without or 'lacking anything'} ({self.tier}, {kind}): {self.plan}"

    def plain(self) -> dict[str, Any]:
        """Everything but the actions."""
        kept = {key: value for key, value in vars(self).items() if key != "actions"}
        return {**kept, "lacks": [list(pair) for pair in self.lacks], "unmoved": list(self.unmoved)}

    def store(self, folder: Path) -> None:
        """Write the actions and everything else as `<name>.npz`.

        Raises:
            BadConfig: it cannot be written.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with open(folder / f"{self.name}.npz", "wb") as file:
                np.savez_compressed(file, actions=self.actions, about=json.dumps(self.plain()))
        except OSError as error:
            raise BadConfig(f"{folder} cannot be written: {error.strerror}; choose another to=") from None

    @classmethod
    def load(cls, path: Path) -> "Hit":
        """Read what `store` has written."""
        with np.load(path, allow_pickle=False) as stored:
            about, actions = json.loads(str(stored["about"])), np.asarray(stored["actions"], np.float32)
        about["lacks"] = tuple((one, other) for one, other in about["lacks"])
        return cls(**{**about, "unmoved": tuple(about["unmoved"])}, actions=actions)


def causal(arena: Arena) -> frozenset[Pair]:
    """Contacts without which the oracle never reaches the goal: latched in the witness and in every jittered run.

    Contacts of the robot with what cannot move are left out: a hand may come at a thing from another side.
    """
    found = arena.trace.signature.pairs
    limits = Robust()
    for k in range(VARIED):
        jitter = Jitter(
            f"{arena.scenario.id}/attack/{k}",
            limits.position,
            limits.turn,
            limits.mass,
            limits.friction,
            limits.noise,
            k % 2 * limits.latency,
        )
        world = jitter.disturbed(arena.world)
        try:
            rollout = run(arena.scenario, world, arena.scenario.oracle, arena.horizon, SETTLE, jitter)
        except NoOracle:
            break
        if rollout.solved:
            found &= pairs(world)
    return found


def hit(
    arena: Arena, attempt: Attempt, raw: bool, played: Played, node: Node | None, needed: frozenset[Pair]
) -> Hit | None:
    """The evidence for a success, or None if it does not come out the same in a fresh world.

    Args:
        node: where the attempt began.
        needed: causal contacts, see `causal`.
    """
    fresh = World.load(arena.scene_xml, arena.embodiment)
    again = replay(arena.scenario, fresh, played.actions, arena.horizon, SETTLE)
    if not again.solved or again.digest != played.digest:
        return None
    left = played.signature
    return Hit(
        arena.scenario.id,
        attempt.tier,
        raw,
        (node or arena.start).after(attempt),
        played.seconds,
        played.digest,
        tuple(sorted(needed - left.pairs)),
        tuple(sorted(arena.trace.signature.moved - left.moved)),
        played.actions,
    )


@dataclass(frozen=True)
class Rate:
    """How often one tier reached the goal, filtered or raw."""

    tier: str
    raw: bool
    rollouts: int = 0
    hits: int = 0
    refuting: int = 0

    @property
    def value(self) -> float:
        return self.hits / self.rollouts if self.rollouts else 0.0

    @property
    def bound(self) -> float:
        """One-sided upper Clopper-Pearson bound at 95 % confidence."""
        return 1.0 - lower_bound(self.rollouts - self.hits, self.rollouts) if self.rollouts else 1.0

    def plain(self) -> dict[str, Any]:
        return {**asdict(self), "rate": self.value, "bound": self.bound}


def rates(counts: Sequence[Rate]) -> list[Rate]:
    """Counts of the same tier and kind added up, in the order in which they first occur."""
    total: dict[tuple[str, bool], Rate] = {}
    for one in counts:
        sofar = total.get((one.tier, one.raw), Rate(one.tier, one.raw))
        total[one.tier, one.raw] = replace(
            sofar,
            rollouts=sofar.rollouts + one.rollouts,
            hits=sofar.hits + one.hits,
            refuting=sofar.refuting + one.refuting,
        )
    return list(total.values())
