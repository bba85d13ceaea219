"""Place and time at which the witness of a scenario diverges under two versions of MuJoCo: the cause of a verdict that
flips.

The same actions move the same scene under both versions, so bodies are equal up to rounding until a contact amplifies
it. The first body that is elsewhere, and what it touches then, name that contact. Runs in each environment.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from .. import compose
from ..episode import Episode
from ..pool import Pool, PoolRow
from ..samplers.task import Task
from ..validate.rebuilt import world_of
from ..validate.verify.stored import task_of_manifest
from .environment import answer

PERIODS = 5
"""Control periods from one sample of a track to the next: 50 ms."""
TRACK_DISTANCES = (0.1, 1.0, 10.0)
"""Distances between the places of a body under two versions that are looked for [mm]."""

Track = list[dict[str, Any]]
"""Samples of a rollout: the time `at` [s], and by body of the scene its place `pos` [m] and the bodies it touches."""


def track(task: Task, row: PoolRow) -> Track:
    """The places of all moving bodies of the scene while the witness is played, whether or not it succeeds."""
    scenario = task.scenario(row.params)
    world = world_of(scenario, row.embodiment)
    moving = [
        world.model.body(body).name
        for body in np.flatnonzero(world.model.body_weldid != 0).tolist()
        if body not in world.own
    ]
    episode, found = Episode(scenario, world, row.horizon), []
    for period, action in enumerate(row.witness):
        if period % PERIODS == 0:
            bodies = {name: [world.pos(name).tolist(), sorted(world.touching_bodies(name))] for name in moving}
            found.append({"at": round(world.time, 6), "bodies": bodies})
        episode.step(action)
    return found


def parted(one: Track, other: Track) -> list[dict[str, Any]]:
    """The first moments at which a body is 0.1, 1 and 10 mm elsewhere, with what it touches in either track.

    Args:
        one, other: tracks of the same actions under two versions.
    """
    found: list[dict[str, Any]] = []
    for a, b in zip(one, other, strict=False):
        apart = {
            name: 1e3 * float(np.linalg.norm(np.subtract(a["bodies"][name][0], b["bodies"][name][0])))
            for name in a["bodies"].keys() & b["bodies"].keys()
        }
        if not apart:
            break
        body = max(sorted(apart), key=apart.__getitem__)
        for limit in TRACK_DISTANCES[len(found) :]:
            if apart[body] >= limit:
                touching = sorted({*a["bodies"][body][1], *b["bodies"][body][1]})
                found.append({"mm": limit, "seconds": a["at"], "body": body, "touching": touching})
    return found


def in_words(moments: Sequence[Mapping[str, Any]]) -> str:
    """Result of `parted`, in one line."""
    parts = [
        f"{one['body']} {one['mm']:g} mm elsewhere after {one['seconds']:g} s, "
        f"touching {', '.join(one['touching']) or 'nothing'}"
        for one in moments
    ]
    return "; ".join(parts) or f"no body is {TRACK_DISTANCES[0]:g} mm elsewhere while the actions last"


def tracks(folder: str, search: Sequence[str], ids: Sequence[str]) -> Iterator[tuple[str, Track]]:
    """The tracks of some scenarios of a pool, by id."""
    pool = Pool.open(folder).check()
    task = task_of_manifest(pool, compose.load_task(pool.task, search))
    for row in pool.rows():
        if row.id in ids:
            yield row.id, track(task, row)


def answers(request: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """A line for every track that is requested: `pools` has ids by folder; see `commands.verify_mujoco`."""
    for folder, ids in request["pools"].items():
        for name, found in tracks(folder, request["search"], ids):
            yield {"pool": folder, "id": name, "track": found}


if __name__ == "__main__":
    sys.exit(answer(answers))
