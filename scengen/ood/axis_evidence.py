"""All evidence about one OOD axis, gathered for its card."""

import itertools
import json
from collections.abc import Callable, Iterator
from pathlib import Path

from ..errors import Infeasible
from ..runs import generate
from ..samplers.split import ID
from ..samplers.task import Task
from ..scenario import Scenario
from ..validate.settings import CertifySettings
from ..work.log import recorded
from ..work.targets import move_aside, write
from . import behaviour, boundary, features
from .analysis.distance import Energy
from .analysis.distance import energy as energy_distance
from .analysis.space import Space, of_features, of_parameters
from .axis_card import NOT_SEARCHED, AxisCard, AxisSettings
from .axis_card_page import write_page
from .baseline import verdict_of_twins
from .belief import measure_belief

LOGS = ("twins.jsonl", "any.jsonl", "beliefs.jsonl", "boundary.jsonl")
"""Logs of a card in its folder."""
CONTROLS = ("own.jsonl", "any.jsonl")
"""Logs of what was played in training."""


def begun(folder: Path) -> int:
    """Number of twins and trials that earlier runs have finished for a card."""
    return sum(recorded(folder / name) for name in LOGS)


def make_axis_card(
    task: Task,
    certify_settings: CertifySettings,
    settings: AxisSettings,
    folder: Path,
    progress: Callable[[str, int, int], None],
) -> tuple[AxisCard, str]:
    """Gather all evidence and write `card.html` and `card.json`, continuing the runs in `folder`.

    Args:
        certify_settings: settings of the certificates.
        progress: called with the name of the step, the number of twins done, and their total.

    Returns:
        The card, and the reason why it has no pictures; empty if it has them.
    """
    if settings.fresh:
        move_aside(*(folder / name for name in LOGS), *(_controls(task, settings, folder) / name for name in CONTROLS))
    evidence = features.sampled(task, settings.axis)  # first: it takes no rollouts, and may find no feasible index
    made = _certified(task, certify_settings, settings, folder, progress)
    card = _card(task, settings, evidence, made, folder, progress)
    write(folder / "card.json", json.dumps(card.plain(), indent=1) + "\n")
    return card, write_page(task, card, made.pool if made else None, settings.seed, folder / "card.html")


def _card(
    task: Task,
    settings: AxisSettings,
    evidence: features.Evidence,
    made: generate.Summary | None,
    folder: Path,
    progress: Callable[[str, int, int], None],
) -> AxisCard:
    """The card: evidence on features, certified scenarios, and what else is measured for it."""
    controls = _controls(task, settings, folder)
    memories, oracle = behaviour.measure(task, settings.axis, folder, controls, settings.trials, progress)
    baselines = [*memories, *measure_belief(task, settings.axis, folder, settings.trials, progress)]
    boundaries, why_no_path = _boundaries(task, settings, folder, progress)
    energy, energy_of_parameters = _energies(task, settings)
    axis = task.axes[settings.axis]
    return AxisCard(
        task=task.name,
        axis=settings.axis,
        why=axis.why,
        source=axis.source,
        proofs=task.proofs[settings.axis],
        features=list(evidence.departures),
        features_stay=evidence.features_stay,
        funnel=made.funnel if made else {},
        reasons=made.reasons if made else {},
        indices=made.indices if made else 0,
        first_draws=made.first_draws if made else 0,
        verdict=verdict_of_twins(baselines, settings.n),
        baselines=baselines,
        oracle=oracle,
        boundaries=boundaries,
        why_no_path=why_no_path,
        energy=energy,
        energy_of_parameters=energy_of_parameters,
    )


def _controls(task: Task, settings: AxisSettings, folder: Path) -> Path:
    """Folder of what is played in training, which cards of other axes share unless a folder is given."""
    return (folder if settings.to else folder.parent) / f"{task.name}-{ID}"


def _certified(
    task: Task,
    certify_settings: CertifySettings,
    settings: AxisSettings,
    folder: Path,
    progress: Callable[[str, int, int], None],
) -> generate.Summary | None:
    """The run that certifies a pool of the axis; None if no scenario is to be certified."""
    n = settings.count("certify_n")
    if not n:
        return None
    wanted = generate.GenerateSettings(
        split=settings.axis,
        n=n,
        seed=settings.seed,
        workers=settings.workers,
        fresh=settings.fresh,
        pool=str(folder / "pool"),
    )
    return generate.generate(task, certify_settings, wanted, lambda done, *_: progress("certify twins", done, n))


def _energies(task: Task, settings: AxisSettings) -> tuple[Energy, Energy]:
    """Energy distances between the first twins: of their features, and of the parameters that the axis moves."""
    twins = list(itertools.islice(_drawn(task, settings.axis, settings.seed), settings.n))
    training, here = [trained for trained, _ in twins], [scenario for _, scenario in twins]
    columns = of_parameters(task, [*training, *here]).columns
    moved = Space(tuple(column for column in columns if column.name in task.axes[settings.axis].replace))

    def energy(space: Space) -> Energy:
        return energy_distance(space.points(training), space.points(here), twins=True)

    return energy(of_features(task, training, here)), energy(moved)


def _drawn(task: Task, split: str, seed: int) -> Iterator[tuple[Scenario, Scenario]]:
    """Training scenarios and their OOD twins, by index. Infeasible ones are left out."""
    for index in itertools.count():
        try:
            yield task.draw(ID, seed, index).scenario, task.draw(split, seed, index).scenario
        except Infeasible:
            continue


def _boundaries(
    task: Task, settings: AxisSettings, folder: Path, progress: Callable[[str, int, int], None]
) -> tuple[dict[str, boundary.Boundary], str]:
    """Both boundaries, or the reason why there are none."""
    axis = task.axes[settings.axis]
    if reason := boundary.why_no_path(task, axis) or ("" if settings.rounds else NOT_SEARCHED):
        return {}, reason

    def report(done: int, total: int) -> None:
        progress("search boundaries", done, total)

    return boundary.search(task, settings.axis, folder, settings.seed, settings.rounds, report), ""
