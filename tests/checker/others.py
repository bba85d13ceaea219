"""False claims of what is no pool: demonstrations, rollouts of policies, recordings, and folders that are two things.

Each is made from an honest folder that is made once. `says` is a regular expression of what verification answers: the
fault, the difference, or the line of what is only claimed. Nothing false is sound and unsaid.
"""

import copy
import json
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from forgery import Case, Draft
from make_base import BASE

REFERENCE = Path(__file__).parents[2] / "generated" / "reference" / "domino_single-id"
HASH = "ab" * 32
Manifest = dict[str, Any]
Forge = Callable[[Manifest, list[Any], list[Any]], None]
"""Changes the manifest, the rows and the failed rows of a folder of demonstrations."""


def _run(*words: object) -> None:
    from scengen import cli

    assert cli.run([str(word) for word in words]) == 0, words


@cache
def _made(kind: str) -> Path:
    """An honest folder, made once in a process."""
    folder = Path(tempfile.mkdtemp(prefix="scengen-claims-")) / kind
    if kind == "demonstrations":
        _run("demos", "task=domino_single", "n=4", "runs=2", f"to={folder}")
    elif kind == "one":
        _run("demos", "task=domino_single", "n=1", f"to={folder}")
    elif kind == "brief":  # a goal must last for a fifth of the usual time
        _run("demos", "task=domino_single", "n=1", "certify.settle=0.2", f"to={folder}")
    elif kind == "failures":  # a short time limit, of which the task of the manifest tells
        _run("demos", "task=domino_single", "task.horizon=3.0", "n=2", "keep=failed", "limit=12", f"to={folder}")
    elif kind == "apart":
        _run("demos", "task=domino_single", "n=2", "seed=0", f"apart={REFERENCE}", f"to={folder}")
    elif kind in ("idle", "oracle"):
        to = folder.with_name(f"{kind}-evaluation")
        given = (f"pool={REFERENCE}", "seeds=2", "rollouts=1", "keep=[episodes]", f"to={to}")
        _run("evaluate", f"policy={kind}", *given)
        return to / "rollouts" / REFERENCE.name
    else:
        _run("record", f"pool={_made('one')}", f"to={folder}", "cameras=none")
    return folder


def honest(kind: str, target: Path) -> Path:
    """A copy of an honest folder."""
    shutil.rmtree(target, ignore_errors=True)
    return Path(shutil.copytree(_made(kind), target))


def forge(change: Forge, folder: Path) -> None:
    """Change a folder of demonstrations, and write hashes to match."""
    from scengen.pool.demonstrations import DEMONSTRATIONS, Demonstrations, write_demonstrations

    found = Demonstrations.open(folder)
    rows, failures, path = list(found.rows()), list(found.failures()), folder / DEMONSTRATIONS
    plain = json.loads(path.read_text())
    change(plain, rows, failures)
    keep = plain["config"]["keep"]
    config = replace(found.manifest.config, keep=tuple(keep))
    write_demonstrations(folder, replace(found.manifest, config=config), rows, failures)
    entries = json.loads(path.read_text())
    files = {name: entries[name] for name in ("shards", "failed") if name in entries}
    path.write_text(json.dumps({**plain, **files}))


# --- demonstrations -------------------------------------------------------------------------------------------------


def counted(m: Manifest, rows: list[Any], failures: list[Any], indices: int | None = None) -> None:
    """Let the counts of a manifest follow from its rows, as a careful forger does."""
    kept, lost = len(rows), len(failures)
    m["indices"] = indices or (rows[-1].index * m["config"]["runs"] + rows[-1].run + 1)
    m["styles"] = {style: sum(row.style == style for row in rows) for style in {row.style for row in rows}}
    reasons = [f"solved: {row.outcome}: {row.reason}" for row in failures]
    from scengen.pool.manifest import without_numbers

    m["reasons"] = {key: list(map(without_numbers, reasons)).count(key) for key in map(without_numbers, reasons)}
    m["outcomes"] = {"success": kept} if kept else {}
    for row in failures:
        m["outcomes"][row.outcome] = m["outcomes"].get(row.outcome, 0) + 1
    m["funnel"] = {**dict.fromkeys(m["funnel"], kept + lost), "solved": kept}


def without(place: int) -> Forge:
    """One demonstration is removed, and every count fits."""

    def change(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
        del rows[place]
        counted(m, rows, failures)

    return change


def hidden(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
    """A demonstration is removed and counted as a failure."""
    del rows[1]
    reasons = {"solved: timeout: the goal was not reached in # s": 1}
    counted(m, rows, failures)
    m["reasons"], m["outcomes"] = reasons, {"success": len(rows), "timeout": 1}
    m["funnel"] = {**dict.fromkeys(m["funnel"], len(rows) + 1), "solved": len(rows)}


def first_runs(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
    rows[:] = [row for row in rows if row.run == 0]
    counted(m, rows, failures)


def shortest(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
    rows[:] = sorted(sorted(rows, key=lambda row: row.seconds)[:1], key=lambda row: row.index)
    counted(m, rows, failures)


def manifest(**changed: Any) -> Forge:
    """Entries of the manifest are replaced."""
    return lambda m, rows, failures: m.update(changed)


def config(**changed: Any) -> Forge:
    return lambda m, rows, failures: m["config"].update(changed)


def task(**changed: Any) -> Forge:
    """The task is another one, in the manifest and in every row."""

    def change(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
        m["config"]["task"].update(changed)
        of_rows = {name: value for name, value in changed.items() if name in ("instruction", "horizon", "category")}
        rows[:] = [replace(row, **of_rows) for row in rows]

    return change


def version_of(package: str) -> Forge:
    return lambda m, rows, failures: m["versions"].update({package: "9.9.9"})


def driven(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
    """What an oracle has played is said to be driven by a person."""
    m["operator"], m["styles"], m["config"]["styles"] = "op7", {"teleop": len(rows)}, ["teleop"]
    rows[:] = [replace(row, style="teleop") for row in rows]


def times(factor: int) -> Forge:
    def change(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
        m["indices"] *= factor
        m["funnel"]["attempted"] *= factor

    return change


def more_attempts(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
    """Millions of attempts, of which the run is said to have asked for more."""
    m["n"], m["indices"] = 10_000_000, 10_000_000
    m["reasons"] = {"solved: timeout: the goal was not reached in # s": 10_000_000 - len(rows)}
    m["outcomes"] = {"success": len(rows), "timeout": 10_000_000 - len(rows)}
    m["funnel"] = {**dict.fromkeys(m["funnel"], 10_000_000), "solved": len(rows)}


def nothing(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
    rows.clear()
    failures.clear()
    m.update(n=0, indices=0, styles={}, reasons={}, outcomes={}, funnel=dict.fromkeys(m["funnel"], 0))


def reason(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
    failures[0] = replace(failures[0], reason="the robot was unplugged")
    keep = m["indices"]
    counted(m, rows, failures, keep)


def dropped(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
    failures.pop()


def doubled(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
    failures.append(failures[-1])


def twice_failed(m: Manifest, rows: list[Any], failures: list[Any]) -> None:
    failures[:] = [rows[0]] * 5


DEMONSTRATIONS: dict[str, tuple[str, Forge, str]] = {
    "removed": ("demonstrations", without(1), "rows and reasons give 3 attempts, not 4"),
    "removed at the end": ("demonstrations", without(-1), "4 demonstrations were requested, and the run ended with 3"),
    "counted as failed": ("demonstrations", hidden, "made again, attempts without a row fail for other reasons"),
    "second runs removed": ("demonstrations", first_runs, "rows and reasons give 2 attempts, not 3"),
    "shortest kept": ("demonstrations", shortest, "made again|rows and reasons give"),
    "runs halved": ("demonstrations", config(runs=1), "none of the|rows and reasons|occurs twice"),
    "attempts times 10000": ("demonstrations", times(10_000), "run ends with its last attempt|rows and reasons give"),
    "a funnel of millions": ("demonstrations", manifest(funnel={"attempted": 9_000_000}), "the funnel differs"),
    "millions of failures": ("demonstrations", more_attempts, "at most .* are made again"),
    "an invented check": ("demonstrations", manifest(reasons={"weather: rain": 3}), "which is not a check"),
    "an invented reason": ("demonstrations", manifest(reasons={"rest: it moved": 2}), "the funnel differs"),
    "other outcomes": ("demonstrations", manifest(outcomes={"success": 3, "failure": 2}), "other outcomes"),
    "nothing at all": ("demonstrations", nothing, "nothing to judge"),
    "more asked for": ("demonstrations", manifest(n=200), "200 demonstrations were requested|run ends"),
    "a failure left out": ("failures", dropped, "does not hold"),
    "a failure twice": ("failures", doubled, "occurs twice|does not count"),
    "another reason": ("failures", reason, "replayed it is"),
    "instruction": ("demonstrations", task(instruction="Do not touch any domino. Wave."), "│ instruction"),
    "time limit": ("demonstrations", task(horizon=24.0), "│ horizon"),
    "category": ("demonstrations", task(category="dexterity"), "the category is|│ category"),
    "code": ("demonstrations", task(code="T99"), "the code is|│ code"),
    "version of scengen": ("demonstrations", version_of("scengen"), "made with scengen 9.9.9, this is"),
    "platform": ("demonstrations", version_of("platform"), "made with platform 9.9.9, this is"),
    "code of the task": ("demonstrations", manifest(source_sha256=HASH), "made with different code of the task"),
    "version of the task": ("demonstrations", manifest(task_version=9), "made on version 9"),
    "teleoperation": ("demonstrations", driven, "claimed, and not checked: operator op7 drove the robot"),
    "settling time": ("brief", manifest(), "│ settle"),
    "rules": ("demonstrations", config(rules="paper"), "│ rules"),
    "apart from nothing": ("demonstrations", config(apart=[HASH]), "claimed, and not checked: apart from 1 pools"),
    "policy": ("idle", manifest(policy="ours:v9"), "claimed, and not checked: policy 'ours:v9' drove the robot"),
    "perturbed": ("idle", manifest(condition="noise@5", perturb_seed=3), "drove the robot under 'noise@5', seed 3"),
    "perturbed without a seed": ("idle", manifest(condition="noise@5"), "a condition"),
    "perturbed without a policy": ("demonstrations", manifest(condition="blind", perturb_seed=0), "a condition"),
    "failures dropped": ("idle", dropped, "does not hold|the funnel"),
    "failures doubled": ("idle", doubled, "occurs twice"),
    "a success among failures": ("oracle", twice_failed, "is a success among the failed attempts"),
    "counts without files": ("idle", lambda m, rows, failures: failures.clear(), "does not hold|rows and reasons"),
    "other counts": ("oracle", manifest(n=400), "n = 400 rollouts, but rows and reasons give 2"),
    "all failures left out": ("idle", nothing, "nothing to judge"),
}
"""False claims of demonstrations and rollouts: the honest folder, the forgery, and what verification says."""


# --- recordings -----------------------------------------------------------------------------------------------------

ROWS, EPISODES = "data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet"


def column(path: str, name: str, change: Callable[[np.ndarray], Any], folder: Path) -> None:
    """Change a column of the first episode in a table."""
    table = pq.read_table(folder / path)
    length = 1 if path == EPISODES else pq.read_table(folder / EPISODES)["length"][0].as_py()
    values = table[name].to_pylist()
    new = change(np.array(values[:length]))
    values[:length] = new if isinstance(new, list) else new.tolist()
    place = table.schema.get_field_index(name)
    kind = table.schema.field(name).type
    array = pa.array(values) if pa.types.is_list(kind) and path == EPISODES else pa.array(values, kind)
    pq.write_table(table.set_column(place, name, array), folder / path)


def told(name: str, value: Any) -> Callable[[Path], None]:
    return partial(column, EPISODES, name, lambda v: [value])


def rows(name: str, change: Callable[[np.ndarray], Any]) -> Callable[[Path], None]:
    return partial(column, ROWS, name, change)


def _json(name: str, change: Callable[[Any], None], folder: Path) -> None:
    path = folder / name
    plain = json.loads(path.read_text())
    change(plain)
    path.write_text(json.dumps(plain))


def _flipped(values: np.ndarray) -> np.ndarray:
    values[5:9] = ~values[5:9]
    return values


def _off(values: np.ndarray) -> np.ndarray:
    return values + np.float32(0.01)


def _stats(plain: Any) -> None:
    plain["robot0_joint_vel"]["mean"][0] += 1.0


def _swapped(plain: Any, of: str = "robot0_eef_pos") -> None:
    names = plain["features"][of]["names"]
    names[0], names[1] = names[1], names[0]


def _unannounced(folder: Path) -> None:
    _json("meta/info.json", lambda plain: plain["features"].pop("task_index"), folder)


def _narrow(folder: Path) -> None:
    """The rows of the hand's pose have two numbers, and meta/info.json says so."""

    def told(plain: Any) -> None:
        feature = plain["features"]["robot0_eef_pos"]
        feature.update(shape=[2], names=feature["names"][:2])

    table = pq.read_table(folder / ROWS)
    place = table.schema.get_field_index("robot0_eef_pos")
    values = [value[:2] for value in table["robot0_eef_pos"].to_pylist()]
    pq.write_table(
        table.set_column(place, "robot0_eef_pos", pa.array(values, pa.list_(pa.float32(), 2))), folder / ROWS
    )
    _json("meta/info.json", told, folder)


def _twice_as_fast(folder: Path) -> None:
    _json("meta/info.json", lambda plain: plain.update(fps=50), folder)
    rows("timestamp", lambda values: values / 2)(folder)


def _accepted(folder: Path) -> None:
    (folder / "curation").mkdir()
    (folder / "curation/scores.csv").write_text("episode,score\n0,5\n")
    (folder / "curation/decisions.csv").write_text("episode,verdict,who,why\n0,accept,me,fine\n")


def _perturbed(kinds: str, seed: Any, folder: Path) -> None:
    """Every episode says that what it shows was perturbed."""
    table = pq.read_table(folder / EPISODES)
    for name, value in (("perturb", kinds), ("perturb_seed", seed)):
        table = table.append_column(f"scengen/{name}", pa.array([value] * len(table)))
    pq.write_table(table, folder / EPISODES)


def _copied(kinds: str, folder: Path) -> None:
    """The only episode a second time, under another seed of a perturbation."""
    rows, episodes = pq.read_table(folder / ROWS), pq.read_table(folder / EPISODES)
    count = len(rows)
    again = rows.to_pydict()
    again["index"], again["episode_index"] = [n + count for n in again["index"]], [1] * count
    pq.write_table(pa.concat_tables([rows, pa.table(again, rows.schema)]), folder / ROWS)
    (one,) = episodes.to_pylist()
    two = {**one, "episode_index": 1, "dataset_from_index": count, "dataset_to_index": 2 * count}
    both = [{**each, "scengen/perturb": kinds, "scengen/perturb_seed": seed} for seed, each in enumerate((one, two))]
    schema = episodes.schema.append(pa.field("scengen/perturb", pa.string()))
    pq.write_table(
        pa.Table.from_pylist(both, schema.append(pa.field("scengen/perturb_seed", pa.int64()))), folder / EPISODES
    )


def _instruction(folder: Path) -> None:
    table = pq.read_table(folder / "meta/tasks.parquet")
    array = pa.array(["Wave."], pa.string())
    pq.write_table(table.set_column(1, table.schema.field(1), array), folder / "meta/tasks.parquet")


RECORDINGS: dict[str, tuple[Callable[[Path], None], str]] = {
    "joint velocities": (rows("robot0_joint_vel", _off), "REPLAY|STATE_MISMATCH"),
    "forces": (rows("force_torque", _off), "REPLAY"),
    "forces in the world": (rows("force_torque_world", _off), "REPLAY"),
    "tactile": (rows("robot0_tactile_left", _off), "REPLAY"),
    "reward": (rows("next.reward", _off), "REPLAY"),
    "own reward": (rows("reward", _off), "REPLAY"),
    "done": (rows("next.done", _flipped), "REPLAY"),
    "success": (rows("next.success", _flipped), "REPLAY"),
    "task index": (rows("task_index", lambda v: v + 1), "INSTRUCTION"),
    "instruction": (_instruction, "INSTRUCTION"),
    "instruction of an episode": (told("tasks", ["Wave."]), "INSTRUCTION"),
    "statistics": (partial(_json, "meta/stats.json", _stats), "STATS"),
    "statistics of an episode": (told("stats/action/mean", [9.0] * 7), "STATS"),
    "number of episodes": (partial(_json, "meta/info.json", lambda p: p.update(total_episodes=9)), "INFO"),
    "number of rows": (partial(_json, "meta/info.json", lambda p: p.update(total_frames=9)), "INFO"),
    "names": (partial(_json, "meta/info.json", _swapped), "INFO"),
    "names of bodies": (
        partial(_json, "meta/info.json", partial(_swapped, of="observation.environment_state")),
        "INFO",
    ),
    "column without a description": (_unannounced, "INFO"),
    "a perturbation that shows nowhere": (partial(_perturbed, "light_direction@3", 0), "REPLAY"),
    "a perturbation of readings": (partial(_perturbed, "proprioception_noise@1", 0), "REPLAY"),
    "an unknown perturbation": (partial(_perturbed, "magic@1", 0), "REPLAY"),
    "half a seed": (partial(_perturbed, "reworded@1", 0.5), "REPLAY"),
    "other words": (partial(_perturbed, "reworded@1", 0), "TASK"),
    "a copy in a look that shows nowhere": (partial(_copied, "light_direction@3"), "REPLAY"),
    "a copy in words that it does not have": (partial(_copied, "verbose@1"), "DUPLICATE"),
    "two numbers for a place": (_narrow, "MISSING_FIELD"),
    "rate": (_twice_as_fast, "INFO"),
    "robot": (partial(_json, "meta/info.json", lambda p: p.update(robot_type="panda_suction")), "INFO|not a recording"),
    "paths": (partial(_json, "meta/info.json", lambda p: p.update(data_path="../{chunk_index}.parquet")), "INFO"),
    "verdicts": (_accepted, "1 scores and 1 verdicts are those of people"),
    "id": (told("scengen/id", "0123456789ab"), "LABEL"),
    "code": (told("scengen/code", "T99"), "LABEL"),
    "split": (told("scengen/split", "wide_gaps"), "LABEL|DRAW"),
    "axes": (told("scengen/axes", ["wide_gaps"]), "LABEL"),
    "seed": (told("scengen/seed", 7), "DRAW"),
    "index": (told("scengen/index", 77), "DRAW"),
    "twin": (told("scengen/id_twin", "0123456789ab"), "DRAW"),
    "shifted": (told("scengen/shifted", '{"gap": 1.0}'), "DRAW"),
    "horizon": (told("scengen/horizon", 99.0), "TASK"),
    "scene hash": (told("scengen/scene_sha256", HASH), "LABEL"),
    "seconds": (told("scengen/seconds", 0.5), "LABEL"),
    "success of an episode": (told("scengen/success", False), "LABEL"),
    "version": (told("scengen/task_version", 9), "TASK"),
    "bodies": (told("scengen/absent", "slab"), "LABEL"),
    "rules": (told("scengen/rules", "paper"), "TASK"),
    "file": (told("data/file_index", 3), "EPISODE_TABLE"),
    "style": (told("scengen/style", "perfect"), "scengen/style"),
    "source": (told("scengen/source", "teleop"), "scengen/source"),
    "operator": (told("scengen/operator", "op9"), "scengen/operator"),
    "run": (told("scengen/run", 3), "scengen/run"),
    "hash of the actions": (told("scengen/witness_sha256", HASH), "scengen/witness_sha256"),
}
"""False claims of recordings: the forgery, and the finding or the claimed column that `curate` names."""


# --- folders that are two things ------------------------------------------------------------------------------------


def false_pool(folder: Path) -> None:
    """Put a pool with weaker gravity beside what is there."""
    draft = copy.deepcopy(Draft.of(BASE / "single_quick"))
    draft.scene("<option ", '<option gravity="0 0 -1" ', rows=len(draft.rows))
    with tempfile.TemporaryDirectory() as scratch:
        draft.write(Path(scratch, "pool"))
        shutil.copytree(Path(scratch, "pool"), folder, dirs_exist_ok=True)


def _beside(folder: Path) -> None:
    honest("demonstrations", folder)
    false_pool(folder)


def _below(folder: Path) -> None:
    shutil.rmtree(folder)
    honest("demonstrations", folder / "demos")
    false_pool(folder)


def _siblings(folder: Path) -> None:
    shutil.rmtree(folder)
    honest("demonstrations", folder / "demos")
    (folder / "pool").mkdir()
    false_pool(folder / "pool")


def _in_recording(folder: Path) -> None:
    honest("recording", folder)
    false_pool(folder)


MIXED: dict[str, tuple[Callable[[Path], None], str]] = {
    "pool beside demonstrations": (_beside, "a folder must be one of them"),
    "pool above demonstrations": (_below, "REFUTED .*scene"),
    "pools and demonstrations in a folder": (_siblings, "name the folders"),
    "pool in a recording": (_in_recording, "a folder must be one of them"),
}
"""Folders that are two things."""


# --- the corpus -----------------------------------------------------------------------------------------------------


def _forged(kind: str, change: Forge, folder: Path) -> None:
    forge(change, honest(kind, folder))


def _recorded(change: Callable[[Path], None], folder: Path) -> None:
    change(honest("recording", folder))


def _cases() -> list[Case]:
    """Folders of the corpus: what is said counts, whatever the verdict."""
    made: dict[str, tuple[Callable[[Path], None], str]] = {**MIXED}
    made |= {name: (partial(_forged, kind, change), says) for name, (kind, change, says) in DEMONSTRATIONS.items()}
    made |= {f"recorded {name}": (partial(_recorded, change), says) for name, (change, says) in RECORDINGS.items()}
    return [
        Case(f"others__{name.replace(' ', '_')}", "single_quick", "end", says, damage=damage)
        for name, (damage, says) in made.items()
    ]


CASES = _cases()
