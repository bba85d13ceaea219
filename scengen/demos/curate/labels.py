"""What the table of episodes says of an episode, compared with what its task, its parameters and its rows give."""

from collections.abc import Iterator, Mapping
from typing import Any

from ...episode import STRICT
from ...errors import Infeasible, ScengenError, contrasted
from ...export.dataset import TASK_VERSION
from ...export.recording import EPISODE_COLUMNS
from ...pool.columns import plain_value
from ...pool.files import sha256
from ...samplers.split import Split
from ...samplers.task import Task
from ...scenario import Scenario
from ...validate.labels import labels_of_draw
from ...validate.verify.claims import comparable
from .findings import Finding

CLAIMED = ("witness_sha256", "run", "style", "source", "operator")
"""Columns of the table of episodes that nothing in a recording decides. The hash covers the time for which the goal had
to last, which is not recorded."""
DRAWN = ("id", "shifted", "id_twin", "params")
"""Columns that follow from split, seed and index."""


def wrong_labels(
    stored: Mapping[str, Any], task: Task, scenario: Scenario, text: str, instruction: str | None = None
) -> Iterator[Finding]:
    """Findings about the columns of an episode.

    Args:
        stored: row of the table of episodes.
        text: scene that is built from the parameters.
        instruction: the instruction as a perturbation words it; None if it is the task's own.
    """
    for name in EPISODE_COLUMNS:
        if f"scengen/{name}" not in stored:
            yield label(name, "is missing")
    made = {"id": scenario.id, "code": task.code, "scene_sha256": sha256(text), "axes": _axes(stored)}
    for name, here in made.items():
        if plain_value(here) != (there := stored.get(f"scengen/{name}")):
            told, found = contrasted(ascii(there), ascii(here))
            yield label(name, f"is {told}, not {found}")
    yield from _differences(stored, task, instruction)
    yield from _wrongly_drawn(stored, task)


def wrong_result(stored: Mapping[str, Any], success: bool, seconds: float) -> Iterator[Finding]:
    """Findings about the result of an episode.

    Args:
        success: whether the replay reaches the goal.
        seconds: time at which the replay ends [s].
    """
    made = {"success": success, **({"seconds": round(seconds, 6)} if success else {})}
    for name, here in made.items():
        if (there := stored.get(f"scengen/{name}", here)) != here:
            yield label(name, f"is {ascii(there)[:60]}, that of the replay is {here}")


def label(name: str, why: str) -> Finding:
    """The finding about a column of the table of episodes."""
    return Finding("LABEL", "error", (), {}, f"scengen/{name} {why}")


def _axes(stored: Mapping[str, Any]) -> Any:
    try:
        return Split.parse(str(stored.get("scengen/split"))).axes
    except ScengenError:
        return ()


def _differences(stored: Mapping[str, Any], task: Task, instruction: str | None) -> Iterator[Finding]:
    """Differences from the installed task: the recording may be of one that a command line has changed."""
    installed = {"tasks": [instruction or task.instruction], "scengen/horizon": task.horizon, "scengen/rules": STRICT}
    installed[TASK_VERSION] = task.version
    for name, here in installed.items():
        if (there := stored.get(name, here)) != here:
            told, own = contrasted(ascii(there), ascii(here), 100)
            yield Finding("TASK", "warning", (), {}, f"{name} is {told}, that of the installed task is {own}")


def _wrongly_drawn(stored: Mapping[str, Any], task: Task) -> Iterator[Finding]:
    """Whether split, seed and index give this scenario. Another task or design than the installed one may have."""
    try:
        design = task.design(str(stored.get("scengen/sampler", "iid")))
        split, seed, index = (stored[f"scengen/{name}"] for name in ("split", "seed", "index"))
        draw = labels_of_draw(task.draw(str(split), int(seed), int(index), design))
        wrong = [name for name in DRAWN if comparable(plain_value(draw[name])) != comparable(stored[f"scengen/{name}"])]
        why = f"other values of {', '.join(wrong)}" if wrong else ""
    except Infeasible:
        why = "no feasible scenario"
    except (ScengenError, ValueError, TypeError, KeyError) as error:
        why = f"nothing ({' '.join(str(error).split())[:100]})"
    if why:
        yield Finding("DRAW", "warning", (), {}, f"split, seed and index, drawn again, give {why}")
