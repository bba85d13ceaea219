"""Stored behaviour of a task: what it declares and draws, what its rules say, and how rollouts end.

The file `conf/behaviour/<task>.json` says what version N of a task is. As long as a task behaves like its file, every
figure that was measured on version N remains valid, also if code was renamed or moved.
"""

import base64
import hashlib
import json
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import yaml
from llvmlite import binding
from numpy.typing import NDArray

from ..assets.prop import table
from ..errors import Infeasible, PoolError
from ..installation import versions
from ..look.looks import PLAIN
from ..params import parameters
from ..samplers.dists import Dist
from ..samplers.split import ID
from ..samplers.task import Draw, Task
from ..samplers.task_files import facts_file
from ..samplers.task_files import tasks as known_tasks
from ..scenario import Plan, Scenario
from ..sim import scene_text
from ..sim.world import World
from ..validate.identity import source_sha256
from ..validate.rebuilt import portable_sha256
from ..work.fingerprint import fingerprint
from . import edges, rules
from .episodes import episodes_sha256
from .rollouts import Stage

FORMAT = 5
"""Format of a behaviour file, which includes the rollouts and states of which it consists."""
SEED = 7
"""Seed of the draws."""
TRAINING_DRAWS = 3
"""Number of stored training draws. All rollouts are played in the first one, and the oracle alone in the others."""
CORE = ("oracle", "noise 0.3", "idle", "shortcut", "jitter 1", "ablation")
"""Beginnings of the names of the rollouts that are played for every change of the code. Raw shortcuts are not among
them."""
SELF_TEST = ("oracle", "noise 0.3", "idle")
"""Rollouts that the self-test of an installation plays: half of the time of `CORE`, and the same scene and rules."""

Cheat = tuple[Callable[[Scenario, World], Plan], bool]
"""A plan that once reached the goal without the intended means, and whether it acts without the filter."""


@dataclass(frozen=True)
class Behaviour:
    """Behaviour of one version of a task, as plain data."""

    task: str
    version: int
    made: Mapping[str, Any]
    """`machine`, see `machine`; `fingerprint` of machine and controller; `versions` of packages; and `text`, the hash
    of the code at the last full comparison."""
    declared: Mapping[str, Any]
    """Declared values: time limit, instruction, bounds, distributions, hash of the robot."""
    draws: Mapping[str, Mapping[str, Any]]
    """Draws by split and index: id, attempt, portable hashes of scene and ablations, features, facts, orientation."""
    reasons: Sequence[str]
    """Reasons of refutations, to which `constraints` refer by number."""
    constraints: Sequence[Any]
    """Limits of the constraints, see `edges.Edge`."""
    answers: Sequence[str]
    """Answers of the rules, to which `states` and `limits` refer by number."""
    contacts: Sequence[Sequence[str]]
    """Questions about contact that the rules ask, see `rules.Contact`."""
    states: Sequence[Mapping[str, Any]]
    """Stored states and what the rules say of them, of other contacts, and of random changes."""
    limits: Sequence[Any]
    """Limits of the rules: state, coordinate, magnitude, answers before and after, hash of what events write there."""
    rollouts: Mapping[str, Sequence[Any]]
    """Verdict, time [s] and bits of each rollout, see `rollouts.Played`."""

    @classmethod
    def read(cls, path: Path) -> "Behaviour":
        """The behaviour in a file.

        Raises:
            PoolError: it does not exist, it is damaged, or it has another format.
        """
        if not path.is_file():
            raise PoolError(f"no stored behaviour at {path}; write it with python tools/behaviour.py write {path.stem}")
        try:
            plain = json.loads(path.read_text())
            if plain.pop("format") == FORMAT:
                return cls(**plain)
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise PoolError(f"{path} is damaged ({' '.join(str(error).split())[:160]}); restore it") from None
        raise PoolError(f"{path} is not of format {FORMAT}; install the scengen that wrote it, or restore it")

    def write(self, path: Path) -> None:
        """Write the file: one line for each draw, limit, state and rollout."""
        parts, dense = [f'"format": {FORMAT}'], partial(json.dumps, separators=(",", ":"))
        for name, value in asdict(self).items():
            if isinstance(value, Mapping) and value:
                lines = [f"{dense(key)}: {dense(each)}" for key, each in value.items()]
                parts.append(f'"{name}": {{\n' + ",\n".join(lines) + "\n}")
            elif isinstance(value, (list, tuple)) and value:
                parts.append(f'"{name}": [\n' + ",\n".join(map(dense, value)) + "\n]")
            else:
                parts.append(f'"{name}": {dense(value)}')
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("{\n" + ",\n".join(parts) + "\n}\n")


# --- what does not need a rollout -------------------------------------------------------------------------------------


def declared(task: Task) -> dict[str, Any]:
    """Values that a task declares, by name."""
    family = task.family
    found: dict[str, Any] = {
        "family": f"{family.__module__}.{family.__qualname__}",
        "instruction": task.instruction,
        "horizon": task.horizon,
        "embodiment": task.embodiment,
        "robot": robot_sha256(task.embodiment),
        "episodes": episodes_sha256(),
        "answer": _answer(task),
        "questions": _questions(task.name),
        "hold": family.HOLD,
        "moving": list(family.MOVING),
        "disturbed": list(family.DISTURBED),
        "symmetries": sorted(map(repr, family.SYMMETRIES)),
        "certify": json.dumps(task.certify, sort_keys=True),
        "means": [[mean.lasting, mean.after] for mean in task.nominal.means().values()],
        "steps": sorted(task.nominal.steps()),
        "shortcuts": {name: shortcut.to_rest for name, shortcut in task.nominal.shortcuts().items()},
    }
    for p in parameters(task.nominal):
        parts = [p.nominal, p.unit, p.low, p.high, p.period, "hidden" if p.hidden else "seen"]
        found[f"parameter {p.name}"] = parts
    found |= {f"{ID} {name}": quantiles(dist) for name, dist in sorted(task.training.items())}
    for axis in task.axes.values():
        for name, dist in axis.replace.items():
            found[f"{axis.name} {name}"] = [*quantiles(dist), axis.severities, axis.limits.get(name)]
    return found


def _answer(task: Task) -> list[Any]:
    """Number of values that a guess may take, the first and the last one, and the tries; empty without an answer."""
    answer = task.nominal.answer()
    if answer is None:
        return []
    return [
        len(answer.candidates),
        *map(_rounded, answer.candidates[:: max(1, len(answer.candidates) - 1)]),
        answer.tries,
    ]


def _questions(task: str) -> str:
    """Hash of the questions and sub-goals of a task; empty if it has none.

    Rules that prompts state are left out: no answer depends on them.
    """
    path = facts_file(task) if task in known_tasks() else None
    if not path:
        return ""
    questions = {key: value for key, value in yaml.safe_load(path.read_text()).items() if key != "rules"}
    return hashlib.sha256(json.dumps(questions, sort_keys=True).encode()).hexdigest()[:12]


QUANTILES = (1e-9, 0.25, 0.5, 0.75, 1.0 - 1e-9)
"""Numbers in [0, 1] at which the quantiles of a distribution are compared, so that its class may be rewritten."""


def quantiles(dist: Dist) -> list[float]:
    """Values of a distribution, to six digits; one for a constant."""
    found = [_rounded(float(dist.quantile(u))) for u in QUANTILES]
    return found[:1] if len(set(found)) == 1 else found


ROBOT_FIELDS = (
    *("body_mass", "body_inertia", "body_pos", "body_quat", "body_ipos", "jnt_range", "jnt_axis", "jnt_pos"),
    *("dof_damping", "dof_armature", "dof_frictionloss", "geom_size", "geom_pos", "geom_quat", "geom_friction"),
    *("geom_solref", "geom_solimp", "mesh_vert", "site_pos", "site_quat", "actuator_gainprm", "actuator_biasprm"),
    *("actuator_ctrlrange", "actuator_forcerange", "actuator_gear", "geom_contype", "geom_conaffinity", "geom_condim"),
    *("geom_type", "geom_margin", "geom_gap", "jnt_stiffness", "jnt_margin", "cam_pos", "cam_quat", "cam_fovy"),
)
"""Fields of a compiled model that say what the robot is, and how it looks."""


@cache
def robot_sha256(embodiment: str) -> str:
    """Hash of the robot of an embodiment on an empty table, in its first posture, to six digits: a million numbers."""
    world = World.load(scene_text.emit(table())[0], embodiment, PLAIN)
    parts = [np.asarray(getattr(world.model, name), float).ravel() for name in ROBOT_FIELDS]
    parts.append(world.data.qpos)
    text = " ".join(f"{value + 0.0:.6g}" for value in np.concatenate(parts).tolist())
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def splits(task: Task) -> Iterator[tuple[str, int]]:
    """Splits and indices of the stored draws."""
    yield from ((ID, index) for index in range(TRAINING_DRAWS))
    yield from ((axis, 0) for axis in task.axes)


def described(draw: Draw) -> dict[str, Any]:
    """A draw: its scenario, scenes and descriptions."""
    scenario = draw.scenario
    ablations = {name: _scene(spec) for name, spec in scenario.ablations().items()}
    return {
        "id": scenario.id,
        "attempt": draw.attempt,
        "scene": _scene(scenario.build()),
        "ablations": ablations,
        "features": {name: _rounded(value) for name, value in scenario.features().items()},
        "facts": {name: _rounded(value) for name, value in scenario.facts().items()},
        "orientation": str(scenario.orientation),
    }


def drawn(task: Task, split: str, index: int) -> dict[str, Any]:
    """The draw of an index; the reason alone if it has no feasible scenario."""
    try:
        return described(task.draw(split, SEED, index))
    except Infeasible as error:
        return {"infeasible": sorted(error.reasons)}


def _scene(spec: mujoco.MjSpec) -> str:
    return portable_sha256(scene_text.emit(spec)[0])[:12]


def _rounded(value: Any) -> Any:
    return float(f"{value:.6g}") if isinstance(value, float) else value


# --- rules in stored states -------------------------------------------------------------------------------------------


@dataclass
class Book:
    """Answers of the rules by number."""

    answers: list[str] = field(default_factory=list)

    def number(self, answer: str) -> int:
        """Number of an answer, a new one if it was not there."""
        if answer not in self.answers:
            self.answers.append(answer)
        return self.answers.index(answer)

    def numbers(self, pair: tuple[str, str]) -> list[int]:
        return [self.number(answer) for answer in pair]


def packed(state: NDArray[np.float64]) -> str:
    """A state of a world as text, in single precision."""
    return base64.b85encode(zlib.compress(state.astype(np.float32).tobytes(), 9)).decode()


def unpacked(text: str) -> NDArray[np.float64]:
    """The reverse of `packed`."""
    return np.frombuffer(zlib.decompress(base64.b85decode(text)), np.float32).astype(np.float64)


def current_rules(stage: Stage, stored: Behaviour) -> dict[str, Any]:
    """Entries `answers`, `states` and `limits` of a behaviour as the rules answer now."""
    book, scenario, world = Book(list(stored.answers)), stage.scenario, stage.world
    contacts = [rules.Contact(*each) for each in stored.contacts]
    along = list(rules.coordinates(world))
    probes = [rules.Probe(scenario, world, unpacked(each["state"]), contacts) for each in stored.states]
    states = [_answers(probe, k, along, book, stored.states[k]["state"]) for k, probe in enumerate(probes)]
    limits = []
    for state, text, magnitude, *_ in stored.limits:
        probe, place = probes[state], rules.Place.parse(text)
        sides = [book.numbers(side) for side in probe.around(place, magnitude)]
        limits.append([state, text, magnitude, *sides, probe.numbers_around(place, magnitude)])
    return {"answers": book.answers, "states": states, "limits": limits}


def _answers(
    probe: rules.Probe,
    number: int,
    along: Sequence[rules.Coordinate],
    book: Book,
    state: str,
) -> dict[str, Any]:
    """Answers of the rules in a stored state and around it."""
    return {
        "answers": book.numbers(probe.answers()),
        "numbers": probe.numbers(),
        "contacts": list(rules.under_contacts(probe)),
        "swept": list(rules.swept(probe, along)),
        "mixed": list(rules.under_mixtures(probe, number, along)),
        "state": state,
    }


def explored(stage: Stage, states: Sequence[NDArray[np.float64]]) -> dict[str, Any]:
    """Entries `answers`, `contacts`, `states` and `limits` of a new behaviour."""
    book, scenario, world = Book(), stage.scenario, stage.world
    texts = [packed(state) for state in states]
    contacts = rules.contacts_of_rules(scenario, world, [unpacked(text) for text in texts])
    along, described_states, limits = list(rules.coordinates(world)), [], []
    counts: dict[Any, int] = {}
    for number, text in enumerate(texts):
        probe = rules.Probe(scenario, world, unpacked(text), contacts)
        described_states.append(_answers(probe, number, along, book, text))
        for limit in rules.limits(probe, along):
            counts[limit.kind] = counts.get(limit.kind, 0) + 1
            if counts[limit.kind] <= (rules.MAX_LIMITS if limit.place.contacts == "same" else 1):
                numbers = book.numbers(limit.before), book.numbers(limit.after)
                around = probe.numbers_around(limit.place, limit.magnitude)
                limits.append([number, str(limit.place), limit.magnitude, *numbers, around])
    plain = [[contact.table, contact.a, contact.b] for contact in contacts]
    return {"answers": book.answers, "contacts": plain, "states": described_states, "limits": limits}


# --- rollouts ---------------------------------------------------------------------------------------------------------


def is_core(name: str) -> bool:
    """Whether a rollout of the first training draw is played for every change."""
    return name.startswith(CORE) and not name.endswith(", raw")


def rollouts(stage: Stage, wanted: Callable[[str], bool], steady: bool = False) -> dict[str, list[Any]]:
    """Play the wanted rollouts of a scenario. The oracle is always played, because others repeat its actions.

    Args:
        steady: whether to find out, in disturbed worlds, which verdicts rounding decides.
    """
    found: dict[str, list[Any]] = {}
    for name, how in stage.plays():
        if name == "oracle" or wanted(name):
            result = stage.play(name, how)
            found[name] = [*result.plain, *_unsteady(steady and not stage.steady(result.verdict, how))]
    for name, text in stage.ablations():
        if wanted(f"ablation {name}"):
            result = stage.replay_ablated(text)
            found[f"ablation {name}"] = list(result.plain)
    return found


def _unsteady(flag: bool) -> list[str]:
    return ["unsteady"] if flag else []


def observe(task: Task, cheats: Mapping[str, Cheat], steady: bool = True) -> Behaviour:
    """Observe all of a task's behaviour again, as a file stores it.

    Args:
        cheats: kept cheats of the task by name.
        steady: see `rollouts`.
    """
    stage = Stage(task.draw(ID, SEED, 0).scenario, task.embodiment, task.horizon, cheats)
    start = stage.world.state()
    first: dict[str, NDArray[np.float64]] = {}
    last: dict[str, NDArray[np.float64]] = {}

    def keep(world: World, answer: str, state: NDArray[np.float64], before: str) -> None:
        if world is stage.world:  # other scenes have other states
            first.setdefault(answer, world.state())
            last.setdefault(before, state)

    stage.on_change = keep
    played = rollouts(stage, lambda name: True, steady)
    stage.on_change = None
    found = explored(stage, rules.chosen(start, last, first))
    starts = [task.draw(ID, SEED, index).scenario for index in range(TRAINING_DRAWS)]
    reasons: list[str] = []
    return Behaviour(
        task.name,
        task.version,
        made(task),
        declared(task),
        {f"{split} {index}": drawn(task, split, index) for split, index in splits(task)},
        constraints=[edge.plain(reasons) for edge in edges.edges(task, starts, SEED)],
        reasons=reasons,
        rollouts={f"{ID} 0 {name}": result for name, result in played.items()} | oracles(task),
        **found,
    )


def oracles(task: Task) -> dict[str, list[Any]]:
    """Rollouts of the oracle in the stored draws but the first one."""
    found = {}
    for split, index in splits(task):
        if (split, index) != (ID, 0):
            try:
                stage = Stage(task.draw(split, SEED, index).scenario, task.embodiment, task.horizon)
            except Infeasible:
                continue
            found[f"{split} {index} oracle"] = rollouts(stage, lambda name: False)["oracle"]
    return found


def made(task: Task) -> dict[str, Any]:
    """With what a behaviour is observed."""
    values = {"machine": machine(), "fingerprint": fingerprint(), "versions": versions()}
    return {**values, "text": source_sha256(task.family)}


@cache
def machine() -> str:
    """Hash of how this machine rounds without any code of scengen: MuJoCo, numpy, and the processor for which numba
    compiles. The fingerprint changes with the controller, too."""
    model = mujoco.MjModel.from_xml_string(TUMBLING)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 300)
    numbers = np.sin(np.arange(1.0, 200.0)).reshape(-1, 1) ** np.arange(1, 20)
    product = np.linalg.solve(numbers.T @ numbers + np.eye(19), np.exp(-np.arange(19.0)))
    parts = [binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()]
    return hashlib.sha256(data.qpos.tobytes() + product.tobytes() + "".join(parts).encode()).hexdigest()[:16]


TUMBLING = """
<mujoco><option cone="elliptic" impratio="20"/><worldbody><geom type="plane" size="1 1 1"/>
<body pos="0 0 0.3" euler="20 30 40"><freejoint/><geom type="box" size="0.03 0.02 0.05"/></body>
<body pos="0.01 0 0.5"><freejoint/><geom type="capsule" size="0.02 0.04"/></body></worldbody></mujoco>
"""
"""Two bodies that fall on each other."""


def played_afresh(task: Task, seed: int, count: int) -> dict[str, Any]:
    """Fresh training draws and their core rollouts, to be compared with those of another state of the code."""
    found: dict[str, Any] = {}
    for index in range(count):
        try:
            draw = task.draw(ID, seed, index)
        except Infeasible as error:
            found[str(index)] = sorted(error.reasons)
            continue
        found[f"{index} draw"] = described(draw)
        stage = Stage(draw.scenario, task.embodiment, task.horizon)
        found |= {f"{index} {name}": result for name, result in rollouts(stage, is_core).items()}
    return found
