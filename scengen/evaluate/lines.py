"""Lines of an evaluation: one for each episode, with digests by which the episode can be rebuilt.

`episodes.jsonl` is a text file to which a line is appended when an episode ends: a killed run loses no episode that has
ended, which a Parquet file cannot promise. `run.json` next to it holds the settings on which all lines depend. Each
line ends with a hash of itself and of the line before it; the first one continues the hash of the settings.
"""

import csv
import hashlib
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, get_args, get_origin

import numpy as np

from ..errors import BadConfig
from ..pool.files import sha256
from ..pool.untrusted import read_json
from ..sim.world import World
from ..work.plain import MAX_JOURNAL, read_plain
from ..work.typed import typed
from .arms import ARMS
from .settings import Condition, RolloutId

FORMAT = 1
"""Format of the lines."""
RUN = "run.json"
"""File with the settings on which all lines depend."""
FOLDER = "rollouts"
"""Folder of the kept actions of clean rollouts, below that of the evaluation; those of others have longer names."""
CSV = "episodes.csv"
"""File with the same lines for programs that do not read JSON."""
CHAIN = "sha256"
"""Name of the hash that ends a line."""
STATE_DIGITS = 9
"""Digits after the point that count in the digest of a first state: machines round the last ones differently."""


@dataclass(frozen=True, kw_only=True)
class EpisodeLine:
    """One episode. The fields are the schema of the file, in the order of its columns."""

    episode: int
    """Number of the line in its file, from 0."""
    policy: str
    """Name of the policy."""
    task: str
    """Name of the task."""
    task_version: int
    """Version of the task."""
    category: str
    """Category of the task."""
    split: str
    """Split of the scenario."""
    skill: str
    """Task, split and everything else that differs from a clean training episode, in one word for other programs."""
    pool: str
    """Folder of the pool."""
    scenario: str
    """Id of the scenario."""
    id_twin: str
    """Id of the training scenario of the same index."""
    seed: int
    """Seed of the draws of the pool."""
    index: int
    """Index of the draw."""
    rollout: int
    """Number of the rollout of the scenario, from 0."""
    shifted: Mapping[str, float]
    """Values of the parameters that the axes move."""
    perturbation: str
    """Kinds of perturbation at their levels; `none` without one."""
    perturb: Mapping[str, Mapping[str, Any]]
    """Values that the perturbation drew, by kind."""
    arm: str
    """Name of the arm; `clean` without an intervention."""
    instruction: str
    """Instruction that the environment held for the policy."""
    instruction_sha256: str
    """Hash of the instruction."""
    instruction_read: bool
    """Whether the policy has read an instruction."""
    scene_sha256: str
    """Hash of the scene, that of the pool."""
    first_state: str
    """Digest of the first state, see `state_digest`; empty if the process died."""
    pictures: Mapping[str, str]
    """Digest of the first picture of each camera as the policy received it."""
    renderer: str
    """Name of the renderer of the pictures; empty without pictures."""
    policy_seed: int
    """Seed of the random numbers of the policy."""
    success: bool
    """Whether the goal was reached under the rules of the run."""
    reason: str
    """Reason of a failure; empty for a success."""
    lacks: str
    """Means of the task without which the goal was reached, joined by semicolons."""
    phase: str
    """Phase at the end, one of `player.PHASES`; empty if the process died."""
    seconds: float
    """Time at the end of the episode [s]."""
    crashed: str
    """Error that ended the policy; empty if it played to the end."""
    actions: int
    """Number of control periods."""
    actions_sha256: str
    """Hash of the actions that the controller received."""
    final_state: str
    """Hash of the physics state at the end, sixteen hex digits."""
    machine: str
    """Fingerprint of the machine's rounding, see `work.fingerprint`."""
    scengen: str
    """Version of scengen."""
    mujoco: str
    """Version of MuJoCo."""
    sha256: str
    """Hash of the hash of the line before and of the other fields of this one."""

    @classmethod
    def of(cls, plain: Mapping[str, Any]) -> "EpisodeLine":
        """The line of plain data.

        Raises:
            ScengenError: a field is missing, unknown or of another type.
        """
        return typed("", cls, plain, exact=True)


Lines = Sequence[Mapping[str, Any]]
"""Lines as plain data."""
COLUMNS = tuple(field.name for field in fields(EpisodeLine))
"""Names of the fields of a line."""
_JSON_TYPES = {int: "integer", float: "number", str: "string", bool: "boolean", Mapping: "object"}


def schema() -> dict[str, Any]:
    """The schema of a line as JSON Schema."""
    properties = {field.name: _json_type(field.type) for field in fields(EpisodeLine)}
    about = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": f"episode, format {FORMAT}"}
    return {
        **about,
        "type": "object",
        "properties": properties,
        "required": list(COLUMNS),
        "additionalProperties": False,
    }


def _json_type(kind: Any) -> dict[str, Any]:
    """JSON Schema of the type of a field."""
    told: dict[str, Any] = {"type": _JSON_TYPES[get_origin(kind) or kind]}
    inner = get_args(kind)
    return {**told, "additionalProperties": _json_type(inner[1])} if inner and inner[1] is not Any else told


def chained(before: str, plain: Mapping[str, Any]) -> str:
    """Hash that ends a line.

    Args:
        before: hash at the end of the line before, or `run_sha256` for the first line.
        plain: the line, with or without its own hash.
    """
    own = {name: value for name, value in plain.items() if name != CHAIN}
    return sha256(f"{before}\n{json.dumps(own, sort_keys=True)}")


def renewed(identity: Mapping[str, Any], lines: Lines) -> list[dict[str, Any]]:
    """Lines in a new order, with new numbers and hashes.

    Args:
        identity: settings of the run.
    """
    found, before = list[dict[str, Any]](), run_sha256(identity)
    for number, line in enumerate(lines):
        moved = {**line, "episode": number}
        before = moved[CHAIN] = chained(before, moved)
        found.append(moved)
    return found


def run_sha256(identity: Mapping[str, Any]) -> str:
    """Hash of the settings of a run, which the first line continues."""
    return sha256(json.dumps(identity, sort_keys=True))


def state_digest(world: World) -> str:
    """Digest of the state of a world, sixteen hex digits, the same on machines with different rounding."""
    data = world.data
    parts = (data.qpos, data.qvel, data.act, data.mocap_pos, data.mocap_quat, data.userdata)
    return _digest(np.concatenate([np.round(part, STATE_DIGITS).ravel() + 0.0 for part in parts]).tobytes())


def picture_digest(picture: Any) -> str:
    """Digest of a picture, sixteen hex digits."""
    return _digest(np.ascontiguousarray(picture).tobytes())


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def kept_folder(results: Path, which: RolloutId) -> Path:
    """Folder of the kept actions of a rollout in a folder of results."""
    words = [FOLDER, *([str(which.condition)] if which.condition else [])]
    return results / "-".join(words).replace("/", "-") / Path(which.pool).name


def condition_of(folder: Path) -> Condition:
    """The condition whose actions a folder of `kept_folder` holds."""
    words = folder.parent.name.split("-")[1:]
    arms = [word for word in words if word in ARMS]
    return Condition(*(word for word in words if word not in ARMS), **({"arm": arms[0]} if arms else {}))


def read_lines(path: Path) -> list[Any]:
    """What the lines of a file hold, as plain data.

    Raises:
        BadConfig: the file is missing, or a line is not JSON.
    """
    try:
        return [read_json(line.decode()) for line in read_plain(path, MAX_JOURNAL).splitlines()]
    except (ValueError, OSError) as error:
        raise BadConfig(f"{path} cannot be read: {' '.join(str(error).split())[:160]}") from None


def as_csv(lines: Iterable[Mapping[str, Any]]) -> str:
    """Lines as comma-separated values, with mappings as JSON."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([_cell(line[name]) for name in COLUMNS] for line in lines)
    return text.getvalue()


def _cell(value: Any) -> Any:
    return json.dumps(value, sort_keys=True) if isinstance(value, (Mapping, bool)) else value
