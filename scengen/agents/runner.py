"""Runs of `scengen agent`: the scenarios of some pools through one stage, with a journal of calls and results."""

import itertools
import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from .. import compose
from ..control.teleop import TELEOP
from ..envs.gym import PoolEnv
from ..envs.observations import cameras_of
from ..errors import BadConfig, UnknownName, cut
from ..evaluate.recorder import Player, Recorder
from ..perturb.language import Words
from ..perturb.perturbation import Perturbation
from ..pool import Pool, PoolRow, collection
from ..samplers.split import ID
from ..samplers.task import Task
from ..work.limits import at_least
from ..work.log import Log
from ..work.plain import read_plain
from ..work.targets import try_folder, write
from ..work.typed import typed
from . import facts
from .acting import MODES, SEE, act
from .calls import CALLS, Budget, Calls, OutOfBudget, estimate
from .endpoint import Endpoint
from .execution import EXECUTIONS, Executions
from .facts import SIMPLEST_PLAN, Answer, Fact, Sheet
from .grading import decided
from .models import Model, RefusedRequest, Turn, made
from .prices import prices
from .priors import Prior, priors
from .questioning import ACT, EMPTY, PLAN, UNDERSTAND, Exam, Result, make_plan, plan_turns, understand, understand_turns
from .scene import observe, streams
from .standins import STAND_INS, Key

STAGES = (UNDERSTAND, PLAN, ACT)
"""Numbers of the stages."""
SETTINGS = "settings.json"
"""Name of the file with the settings of the last run in a folder."""
LINES = "lines"
"""Name of the folder of the lines of stage 3, with a folder for each task."""
MAX_REFUSED = 3
"""Number of scenarios one after the other whose requests a model refuses, after which a run ends."""
TRANSCRIPT = "transcript:"
"""Prefix of a model that is the journal of an earlier run."""


@dataclass(frozen=True)
class AgentSettings:
    """Settings of `scengen agent`; conf/command/agent.yaml explains them."""

    model: str = ""
    pool: str | list[str] = ""
    stage: int = UNDERSTAND
    to: str | None = None
    url: str | None = None
    key: str = ""
    timeout: float = 600.0
    omit: list[str] = field(default_factory=list)
    strict: bool = False
    seeds: int = 20
    temperatures: list[float] = field(default_factory=lambda: [0.0])
    pictures: bool = True
    width: int = 384
    perturb: str | None = None
    perturb_seed: int = 0
    moments: int = 3
    spacing: float = 0.5
    budget: Budget = Budget()
    prices: list[float] | str | None = None
    max_cost: float | None = None
    mode: str = SEE
    explore: int = 0
    execute: bool = True
    dry: bool = False

    @cached_property
    def folders(self) -> list[str]:
        """Folders of the pools."""
        return collection.folders(self.pool)

    @property
    def perturbation(self) -> Perturbation:
        """Perturbation of what the model sees and reads."""
        return Perturbation.parse(self.perturb)

    @property
    def title(self) -> str:
        """Model and perturbation, for tables."""
        return f"{self.model} under {self.perturbation}" if self.perturbation else self.model

    @property
    def folder(self) -> Path:
        """Folder of the results."""
        plain = "".join(letter if letter.isalnum() or letter in ".-" else "_" for letter in self.model)
        return Path(self.to or f"generated/agent/{plain}")

    def check(self) -> None:
        """Raise `ScengenError` if a setting is not valid."""
        at_least(self, seeds=1, width=16, explore=0, perturb_seed=0)
        self.perturbation  # noqa: B018  (it raises an error)
        self.budget.check()
        if not 0.0 < self.timeout <= 86_400.0:
            raise BadConfig(f"timeout = {self.timeout:g}; it must lie in (0, 86400] s")
        if self.stage not in STAGES:
            raise BadConfig(f"stage = {self.stage}; it must be 1 (understand), 2 (plan) or 3 (act)")
        if self.explore and self.stage != ACT:
            raise BadConfig(f"explore = {self.explore}; free trials belong to stage=3, and stage = {self.stage}")
        if self.mode not in MODES:
            raise UnknownName("mode", self.mode, MODES)
        if not self.temperatures or not all(0.0 <= t <= 2.0 for t in self.temperatures):
            raise BadConfig(f"temperatures = {self.temperatures}; give one or more numbers in [0, 2]")
        if not 1 <= self.moments <= 12 or not 0.0 < self.spacing <= 60.0:
            raise BadConfig(
                f"moments = {self.moments}, spacing = {self.spacing:g}; at most 12 moments, up to 60 s apart"
            )

    @property
    def identity(self) -> dict[str, Any]:
        """Model of a journal: answers of different models are not mixed."""
        return {"model": self.model, "url": self.url}


def find_model(settings: AgentSettings) -> Model | None:
    """The model of the settings; None for a stand-in, which is made for each scenario, and for a transcript.

    Raises:
        BadConfig, UnknownName: there is no such model.
    """
    name = settings.model
    if settings.url:
        return Endpoint(name, settings.url, settings.key, settings.timeout, settings.omit)
    if name in STAND_INS or name.startswith(TRANSCRIPT):
        return None
    if ":" in name:
        return made(name)
    try:
        raise UnknownName("model", name, [*STAND_INS, "module:factory", f"{TRANSCRIPT}FILE"])
    except UnknownName as error:
        raise BadConfig(f"{error}; a model behind an endpoint needs url=http://.../v1") from None


@dataclass(frozen=True)
class Work:
    """A scenario that is to be asked about."""

    task: Task
    pool: str
    row: PoolRow


def works(settings: AgentSettings, search: Sequence[str] = ()) -> list[Work]:
    """The first scenarios of each pool, and their tasks.

    Raises:
        ScengenError: a pool is damaged or empty, its task states no facts, or a perturbation changes nothing of it.
    """
    found = []
    for folder in settings.folders:
        pool = Pool.open(folder).check()
        if not len(pool):
            raise BadConfig(f"{pool.folder} holds no scenario; choose another pool")
        for row in itertools.islice(pool.rows(witness=False), settings.seeds):
            found.append(Work(compose.load_task(row.task, search), folder, row))
    for work in {work.task.name: work for work in found}.values():
        facts.load(work.task, search)
        _check_perturbation(settings, work.row, search)
    return sorted(found, key=lambda work: work.task.name)


def _check_perturbation(settings: AgentSettings, row: PoolRow, search: Sequence[str]) -> None:
    """Raise `BadConfig` if the model is given nothing that the perturbation affects, or the task has no other text."""
    cameras, perturbation = cameras_of(row.embodiment), settings.perturbation
    if settings.stage != ACT:
        perturbation.check_perceived("only stage=3 acts; leave it out")
    given = streams(row.embodiment, settings.pictures)
    seen = [camera for name, camera in cameras.items() if name in given]
    perturbation.check([name for name in given if name not in cameras], seen, setting="pictures=true")
    perturbation.check_words(Words.of(row.task, row.instruction, search))


@dataclass(frozen=True)
class Outcome:
    """Results of a run."""

    results: list[dict[str, Any]]
    """Results as plain data, with the labels of the scenarios."""
    calls: int
    """Number of new calls."""
    tokens: int
    """Tokens of the new calls, as the model counts them."""
    cost: float | None
    """Cost of the new calls; None without prices."""
    notes: Mapping[str, int]
    """What is to be said about requests, and of how many it is true."""
    refused: Sequence[str]
    """Why the model refused requests; the scenarios are in no result, and are asked about again by another run."""
    priors: Mapping[str, Mapping[str, Prior]]
    """Best fixed answers in training and how often they are right, by task and question."""
    stopped: str
    """Reason why the run ended before all was asked; empty if it did not."""


def run(
    settings: AgentSettings, progress: Callable[[int, int], None], ask: bool = True, search: Sequence[str] = ()
) -> Outcome:
    """Ask about every scenario, grade, and write `results-<stage>.jsonl`. A repeated run asks only what is missing.

    Args:
        settings: settings of the command.
        progress: called with the number of scenarios done, and their total.
        ask: whether a model may be asked; else only the journal answers.
        search: overrides that add folders of other packages, see `task_files.search_path`.

    Raises:
        ScengenError: a pool, a model or a setting is not valid, or the model cannot be reached.
    """
    settings.check()
    model, todo = find_model(settings) if ask else None, works(settings, search)
    folder = settings.folder
    try_folder(folder)
    path = folder / CALLS
    with (
        Log(path, settings.identity, "choose another to= for another model") as log,
        Log(folder / EXECUTIONS, {"plans": "carried out"}) as played,
    ):
        known_prices = prices(settings.prices, settings.model, settings.max_cost)
        calls = Calls(log, model, settings.budget, known_prices, settings.strict)
        executions = Executions(played) if settings.execute else None
        if settings.model.startswith(TRANSCRIPT):
            calls.recall(Path(settings.model.removeprefix(TRANSCRIPT)))
        write(folder / SETTINGS, json.dumps(asdict(settings), indent=1) + "\n")
        results, stopped, total = list[dict[str, Any]](), "", len(todo) * len(settings.temperatures)
        refused, in_a_row, perturbed = list[str](), 0, {"perturbation": str(settings.perturbation)}
        recorders = dict[str, Recorder]()
        try:
            for work, exam, env in exams(settings, todo, ask, search):
                recorder = _recorder(settings, work, env, recorders, search)
                try:
                    found = _stages(settings, exam, calls, env, twins(settings, todo, work), recorder)
                except RefusedRequest as error:
                    if recorder:
                        recorder.discard()
                    refused, in_a_row = [*refused, str(error)], in_a_row + 1
                    if in_a_row == MAX_REFUSED:
                        raise
                    continue
                in_a_row = 0
                if settings.stage == PLAN and executions:
                    found[-1] = _executed(work, exam, found[-1], executions)
                results += [{**_labels(work), **perturbed, **each.plain()} for each in found]
                progress(sum(r["stage"] == settings.stage for r in results), total)
        except OutOfBudget as error:
            stopped = str(error)
        finally:
            for recorder in recorders.values():
                recorder.discard()
                recorder.close()
        write(folder / f"results-{settings.stage}.jsonl", "".join(json.dumps(r) + "\n" for r in results))
        tasks = {work.task.name: work.task for work in todo} if settings.stage != ACT else {}
        known = {name: priors(task, facts.load(task, search)) for name, task in tasks.items()}
        cost = calls.cost if known_prices else None
        return Outcome(results, calls.new, calls.tokens, cost, calls.notes, refused, known, stopped)


def twins(settings: AgentSettings, todo: Sequence[Work], work: Work) -> list[str]:
    """Ids of the training scenarios in which a model may try before the trial that counts: first the twin of the same
    index, then those of the next indices.

    Raises:
        BadConfig: the pools hold too few.
    """
    row = work.row
    others = [one.row for one in todo if (one.task.name, one.row.split) == (row.task, ID) and one.row.id != row.id]
    others.sort(key=lambda other: (other.seed != row.seed, other.index < row.index, other.index))
    if len(others) < settings.explore:
        raise BadConfig(
            f"explore = {settings.explore} needs as many other training scenarios of {row.task}, and the pools give "
            f"{len(others)}; add a pool of split id, or more seeds="
        )
    return [other.id for other in others[: settings.explore]]


def _recorder(
    settings: AgentSettings, work: Work, env: PoolEnv, known: dict[str, Recorder], search: Sequence[str]
) -> Recorder | None:
    """The recorder of the episodes of a task, which a stage without episodes has not. All are played again by each run,
    from the journal as far as it goes."""
    if settings.stage != ACT:
        return None
    if (name := work.task.name) not in known:
        harness = f"scengen agent stage={ACT} mode={settings.mode} explore={settings.explore}"
        known[name] = Recorder(settings.folder / LINES / name, Player(harness, settings.model), env, search, True)
    return known[name]


def _stages(
    settings: AgentSettings, exam: Exam, calls: Calls, env: PoolEnv, trials: Sequence[str], recorder: Recorder | None
) -> list[Result]:
    """Results of the stage, and of stage 1 before stage 2."""
    if settings.stage == ACT:
        return [act(exam, calls, env, settings.mode, trials, recorder)]
    artefact, first = understand(exam, calls)
    return [first] if settings.stage == UNDERSTAND else [first, make_plan(exam, artefact, calls)]


def _executed(work: Work, exam: Exam, result: Result, executions: Executions) -> Result:
    """The result of stage 2 with what became of its plan; None if the task states no moves."""
    scenario = work.task.scenario(work.row.params)
    outcome = executions.of(work.row, scenario, result.grades["plan"], exam.sheet.plan)
    return replace(result, grades=decided(result.grades, outcome))


def exams(
    settings: AgentSettings, todo: Sequence[Work], ask: bool = True, search: Sequence[str] = ()
) -> Iterator[tuple[Work, Exam, PoolEnv]]:
    """Every scenario at every temperature, seen and ready to be asked about; one environment for each task."""
    for _, group in itertools.groupby(todo, key=lambda work: work.task.name):
        mine = list(group)
        task, sheet = mine[0].task, facts.load(mine[0].task, search)
        told = [sheet.facts_of(task, work.row.params, work.row.certificate.checks) for work in mine]
        folders = list(dict.fromkeys(work.pool for work in mine))
        names = streams(task.embodiment, settings.pictures)
        env = PoolEnv(
            task.name,
            folders,
            names,
            width=settings.width,
            height=settings.width,
            action_filter=TELEOP,
            settle=True,
            search=search,
            perturb=settings.perturb,
            perturb_seed=settings.perturb_seed,
        )
        fixed = {id_: prior.answer for id_, prior in priors(task, sheet).items()} if settings.model == "blind" else {}
        with closing(env):
            for number, work in enumerate(mine):
                moments = 1 if settings.stage == ACT else settings.moments
                view = observe(env, work.row.id, moments, settings.spacing)
                stand_in = _stand_in(settings, mine, told, number, sheet, fixed) if ask else None
                about = _drawn(settings, env)
                for temperature in settings.temperatures:
                    made = (work.row, env.instruction, sheet, told[number], view, temperature, stand_in, about)
                    yield work, Exam(*made), env


def _drawn(settings: AgentSettings, env: PoolEnv) -> dict[str, Any]:
    """Labels of the perturbation of the running scenario; none without one."""
    if not settings.perturbation:
        return {}
    told = {"perturbation": str(settings.perturbation), "perturb_seed": settings.perturb_seed}
    return {**told, "perturb": env.drawn.plain()}


def _stand_in(
    settings: AgentSettings,
    mine: Sequence[Work],
    told: Sequence[tuple[Fact, ...]],
    number: int,
    sheet: Sheet,
    fixed: dict[str, Answer],
) -> Model | None:
    """The stand-in for one scenario; None if the model is none.

    Why the simplest plan fails is the most frequent reason of the other training scenarios in the pools.
    """
    if settings.model not in STAND_INS or settings.url:
        return None
    others = [fact for k, fact in enumerate(told) if k != number and mine[k].row.split == ID]
    reasons = Counter(fact.right for each in others for fact in each if fact.id == SIMPLEST_PLAN and fact.right)
    if reasons:
        fixed = fixed | {SIMPLEST_PLAN: reasons.most_common(1)[0][0]}
    return STAND_INS[settings.model](Key(told[number], sheet.plan, fixed))


def _labels(work: Work) -> dict[str, Any]:
    """Columns of a scenario that tables need."""
    row = work.row
    names = ("task", "category", "split", "seed", "index")
    told = {name: getattr(row, name) for name in names}
    return {"pool": work.pool, "scenario": row.id, **told, "task_version": work.task.version}


def prompts(settings: AgentSettings, search: Sequence[str] = ()) -> Iterator[tuple[Work, list[Turn], tuple[int, int]]]:
    """The first prompt of every scenario, with the estimated tokens of prompt and answer.

    Stage 2 is estimated with the artefact of an empty stage 1.
    """
    settings.check()
    for work, exam, _ in exams(settings, works(settings, search), search=search):
        turns = understand_turns(exam)
        if settings.stage == PLAN:
            turns = plan_turns(exam, EMPTY)
        yield work, turns, estimate(turns)


def earlier(folder: Path) -> AgentSettings:
    """Settings of the last run in a folder.

    Raises:
        BadConfig: it does not exist.
    """
    try:
        return typed("", AgentSettings, json.loads(read_plain(folder / SETTINGS)))
    except (OSError, ValueError, TypeError, RecursionError) as error:
        raise BadConfig(
            f"{cut(str(folder))} holds no run of scengen agent ({cut(str(error))}); give to=FOLDER"
        ) from None
