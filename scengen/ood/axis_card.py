"""The axis card: everything that is known about one OOD axis, on one page."""

import itertools
import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from ..analysis import distance
from ..analysis.space import Space, of_features, of_parameters
from ..errors import BadConfig, Infeasible, UnknownName, at_least
from ..pictures import film, render
from ..pictures.plots import svg
from ..pictures.report import template, thumbnail
from ..pool import Pool, PoolRow
from ..runs import generate
from ..samplers.axis import Proof, spell
from ..samplers.split import ID
from ..samplers.support import Support
from ..samplers.task import Task
from ..scenario import Scenario
from ..statistics import Rate
from ..validate.rebuilt import rebuild
from ..validate.settings import CertifySettings
from ..work.parallel import Workers
from ..work.targets import write
from . import behaviour, boundary, features

NOT_SEARCHED = "boundaries were not searched for (rounds=0)"
SHOWN = 4
"""Twins whose pictures are shown side by side."""


@dataclass(frozen=True)
class AxisSettings:
    """Settings of `scengen axis`; meanings stand in conf/command/axis.yaml."""

    axis: str = ""
    n: int = 50
    any_n: int | None = None
    certify_n: int | None = None
    seed: int = 0
    rounds: int = 20
    workers: Workers = 1
    to: str | None = None

    def check(self, task: Task) -> None:
        """Raise `ScengenError` for a setting that makes no sense for this task."""
        if self.axis not in task.axes:
            raise UnknownName(f"axis of {task.name}", self.axis, task.axes)
        at_least(self, n=2, seed=0, rounds=0, workers=1)
        for name in ("any_n", "certify_n"):
            if not 0 <= (value := self.count(name)) <= self.n:
                raise BadConfig(f"{name} = {value}; it must be from 0 to n = {self.n}")

    def count(self, name: str) -> int:
        """One of `any_n` and `certify_n`: all twins if it is not given."""
        given = getattr(self, name)
        return self.n if given is None else given


@dataclass(frozen=True)
class AxisCard:
    """The evidence about one axis."""

    task: str
    axis: str
    why: str
    source: str
    proofs: list[Proof]
    features: list[features.Departure]
    features_stay: bool
    """Whether features are declared and none of them leaves training."""
    funnel: Mapping[str, int]
    reasons: Mapping[str, int]
    indices: int
    """How many indices had to be tried for the certified scenarios; 0 where none was asked for."""
    first_draws: int
    """How many of them were certified as first drawn."""
    verdict: str
    """The strongest memory that the axis breaks, see `behaviour.verdict`."""
    baselines: list[behaviour.Baseline]
    oracle: Rate | None
    """How often the oracle solves the OOD twins, certified or not."""
    boundaries: dict[str, boundary.Boundary]
    why_no_path: str
    """Why there are no boundaries; empty if there are."""
    energy: distance.Energy
    """Between the features of the first n draws in and out of distribution, in ranges of training."""
    energy_of_parameters: distance.Energy
    """The same between the parameters that move."""

    def plain(self) -> dict[str, Any]:
        """The card as plain data, for JSON."""
        told = asdict(self)
        told["baselines"] = [{**asdict(baseline), "finding": baseline.finding} for baseline in self.baselines]
        told["boundaries"] = {
            k: {**asdict(b), "verdict": b.verdict, "told": str(b)} for k, b in self.boundaries.items()
        }
        return told


def make_axis_card(
    task: Task,
    certify_settings: CertifySettings,
    settings: AxisSettings,
    folder: Path,
    progress: Callable[[str, int, int], None],
) -> tuple[AxisCard, str]:
    """Gather all evidence and write `card.html` and `card.json`, continuing what stands in `folder`.

    Args:
        certify_settings: of the certificates.
        progress: told what is being done, how far it is, and how much there is.

    Returns:
        The card, and why it has no pictures, or nothing.
    """
    name, n, seed = settings.axis, settings.n, settings.seed
    evidence = features.sampled(task, name)
    certify_n, any_n = settings.count("certify_n"), settings.count("any_n")
    made = _certified(task, certify_settings, settings, certify_n, folder, progress) if certify_n else None
    controls = (folder if settings.to else folder.parent) / f"{task.name}-{ID}"
    baselines, oracle = behaviour.measure(task, name, folder, controls, n, any_n, seed, settings.workers, progress)
    boundaries, why_no_path = _boundaries(task, name, folder, seed, settings.rounds, progress)
    twins = list(itertools.islice(_drawn(task, name, seed), n))
    training, here = [t for t, _ in twins], [s for _, s in twins]
    space = of_features(task, training, here)
    moved = Space(
        tuple(c for c in of_parameters(task, [*training, *here]).columns if c.name in task.axes[name].replace)
    )
    axis = task.axes[name]
    card = AxisCard(
        task.name,
        name,
        axis.why,
        axis.source,
        task.proofs[name],
        list(evidence.departures),
        evidence.features_stay,
        made.funnel if made else {},
        made.reasons if made else {},
        made.indices if made else 0,
        made.first_draws if made else 0,
        behaviour.verdict(baselines),
        baselines,
        oracle,
        boundaries,
        why_no_path,
        distance.energy(space.points(training), space.points(here), twins=True),
        distance.energy(moved.points(training), moved.points(here), twins=True),
    )
    write(folder / "card.json", json.dumps(card.plain(), indent=1) + "\n")
    return card, _page(task, card, made.pool if made else None, seed, folder / "card.html")


def _certified(
    task: Task,
    certify_settings: CertifySettings,
    settings: AxisSettings,
    n: int,
    folder: Path,
    progress: Callable[[str, int, int], None],
) -> generate.Summary:
    """A pool of the axis."""
    where, split = str(folder / "pool"), settings.axis
    wanted = generate.Settings(split=split, n=n, seed=settings.seed, workers=settings.workers, pool=where)
    return generate.generate(task, certify_settings, wanted, lambda done, *_: progress("certify twins", done, n))


def _drawn(task: Task, split: str, seed: int) -> Iterator[tuple[Scenario, Scenario]]:
    """Training scenarios and their twins, by index; infeasible ones are left out."""
    for index in itertools.count():
        try:
            yield task.draw(ID, seed, index).scenario, task.draw(split, seed, index).scenario
        except Infeasible:
            continue


def _boundaries(
    task: Task, name: str, folder: Path, seed: int, rounds: int, progress: Callable[[str, int, int], None]
) -> tuple[dict[str, boundary.Boundary], str]:
    """Both boundaries, or why there are none."""
    if reason := boundary.why_no_path(task, task.axes[name]) or ("" if rounds else NOT_SEARCHED):
        return {}, reason
    found = boundary.search(
        task, name, folder, seed, rounds, lambda done, total: progress("search boundaries", done, total)
    )
    return found, ""


# --- the page -----------------------------------------------------------------------------------


def _page(task: Task, card: AxisCard, pool: Pool | None, seed: int, path: Path) -> str:
    """Write the page, with pictures where they are possible. Returns why they are not, or nothing."""
    remark, pairs, strips = "", [], []
    try:
        rows = [row for row, _ in zip(pool.rows(), range(SHOWN), strict=False)] if pool else []
        pairs = [(row.index, *_pair(task, seed, row)) for row in rows]
        strips = [*_strips(task, rows[0])] if rows else []
    except render.NoPictures as error:
        remark = str(error)
    page = template("axis_card.html").render(
        card=card,
        task=task,
        axis=task.axes[card.axis],
        spell=spell,
        steps=("proposed", *generate.STAGES),
        supports=svg(_supports(task, card)),
        path=svg(_path(card)) if card.boundaries else "",
        pairs=pairs,
        strips=strips,
        remark=remark,
    )
    write(path, page)
    return remark


def _pair(task: Task, seed: int, row: PoolRow) -> tuple[str, str]:
    """The training twin and the scenario from the same side, as data addresses for HTML."""
    here, where = thumbnail(row.scene_xml, row.embodiment)
    twin = rebuild(task.draw(ID, seed, row.index).scenario)
    return thumbnail(twin, task.embodiment, where)[0], here


def _strips(task: Task, row: PoolRow) -> list[tuple[str, str]]:
    """Film strips of a witness, and of the shortcut that lasts longest."""
    scenario = task.scenario(row.params)
    tried = {name: film.shortcut(row, scenario, name) for name in scenario.shortcuts()}
    takes = [("the witness", film.Take.witness(row, scenario))]
    if tried:
        name, (take, rollout) = max(tried.items(), key=lambda item: item[1][1].seconds)
        takes.append((f"the shortcut {name}: {rollout.reason}", take))
    return [(title, render.address(render.encode(film.strip(take)), "webp")) for title, take in takes]


def _supports(task: Task, card: AxisCard) -> Figure:
    """Both supports of every parameter that moves, each in its own range."""
    shifts = task.axes[card.axis].replace
    figure = Figure(figsize=(7.5, 0.5 + 0.55 * len(shifts)))
    axes = figure.subplots(len(shifts), 1, squeeze=False)[:, 0]
    for plot, (name, dist) in zip(axes, shifts.items(), strict=True):
        _draw(plot, task.training[name].support, 0.62, "#4a7fb5")
        _draw(plot, dist.support, 0.38, "#b5524a")
        plot.set(yticks=[], ylim=(0.1, 0.9))
        unit = f" [{task.known[name].unit}]" if task.known[name].unit else ""
        plot.set_ylabel(name + unit, rotation=0, ha="right", va="center")
        plot.spines[["left", "right", "top"]].set_visible(False)
    figure.subplots_adjust(hspace=0.9)
    return figure


def _draw(plot: Any, support: Support, y: float, colour: str) -> None:
    for part in support:
        if part.low == part.high:
            plot.plot(part.low, y, "o", color=colour, markersize=7)
        else:
            plot.plot([part.low, part.high], [y, y], color=colour, linewidth=7, solid_capstyle="butt")


def _path(card: AxisCard) -> Figure:
    """Where replay and oracle fail on the path of the axis: interval and guess; lines are where they hold."""
    figure = Figure(figsize=(7.5, 1.5))
    plot = figure.subplots()
    end = max(b.end for b in card.boundaries.values())
    plot.axvspan(0, 1, color="#b5524a", alpha=0.12, lw=0)
    for y, found in enumerate(card.boundaries.values()):
        high = end if found.high is None else found.high
        for part in ((0.0, found.middle), found.again or ()):
            plot.plot(part, [y] * len(part), color="#555", linewidth=2)
        plot.plot([found.low, high], [y, y], color="#555", linewidth=7, alpha=0.35, solid_capstyle="butt")
        marker = {boundary.HOLDS: ">", boundary.OPEN: ""}.get(found.verdict, "x")
        plot.plot(found.middle, y, marker, color="#222", markersize=8, clip_on=False)
    plot.set(yticks=range(len(card.boundaries)), yticklabels=list(card.boundaries), ylim=(-0.6, 1.6), xlim=(0, end))
    plot.set_xlabel("path: 0 the edge of training, 1 the far end of the axis, on to the bounds of the parameters")
    plot.spines[["right", "top"]].set_visible(False)
    if not math.isclose(end, 1.0):
        plot.axvline(1.0, color="#b5524a", lw=1)
    return figure
