"""collect all evidence about an OOD axis on one page, the axis card"""

from pathlib import Path

from rich.table import Table

from ...ood.axis_card import AxisCard, AxisSettings
from ...ood.axis_evidence import begun, make_axis_card
from ...ood.baseline import BELIEF, Baseline
from ...runs.progress import ProgressBar
from ...work.targets import try_folder
from . import OK, Arguments, err, out, remark, say, say_begun
from .settings import read_task


def command(arguments: Arguments) -> int:
    settings, task, certify_settings = read_task("axis card", arguments, AxisSettings)
    settings.check(task)
    folder = Path(settings.to or f"generated/axes/{task.name}-{settings.axis}")
    try_folder(folder)
    say_begun(begun(folder), "twins and trials", folder, settings.fresh)
    with ProgressBar(err, f"probe {task.name}/{settings.axis}", settings.n, settings.workers) as progress_bar:

        def progress(what: str, done: int, total: int) -> None:
            progress_bar.of(min(done, total), total, what)

        card, missing = make_axis_card(task, certify_settings, settings, folder, progress)
    out.print(_table(card))
    if missing:
        remark(f"the card has no pictures: {missing}")
    say(f"wrote {folder / 'card.html'} and card.json")
    return OK


def _result(baseline: Baseline) -> str:
    """Success of one baseline, as text."""
    if not (baseline.training and baseline.here and baseline.excess):
        return baseline.finding
    excess = baseline.excess
    rates = f"{baseline.training.value:.0%} of {baseline.control}, {baseline.here.value:.0%} of {excess.twins} twins"
    lost = f"{excess.value:.0%} lost, 95 % interval {excess.low:.0%} to {excess.high:.0%}"
    return f"{baseline.finding}: {rates} ({lost})"


def _table(card: AxisCard) -> Table:
    """The card in a few lines."""
    table = Table(title=f"{card.task}: axis {card.axis}", title_justify="left", show_header=False)
    for proof in card.proofs:
        relative = f" = {proof.relative:.2g} training ranges" if proof.relative else ""
        table.add_row("outside", f"{proof.parameter}: gap {proof.gap:.3g}{relative} ({proof.kind})")
    for found in card.features:
        how = f"{found.inside} of {found.draws} draws inside training"
        table.add_row("physics", f"{found.feature}: " + (f"leaves training ({found.kind})" if found.leaves else how))
    if card.indices:
        solvable = f"{card.funnel['certified']} of {card.indices} indices certified, {card.first_draws} as first drawn"
        table.add_row("solvable", solvable)
    table.add_row("verdict", card.verdict)
    for baseline in card.baselines:
        kind = "planner" if baseline.name in BELIEF else "memory"
        table.add_row(f"{kind} {baseline.name}", _result(baseline))
    if card.oracle:
        table.add_row("oracle", f"solves {card.oracle.value:.0%} of {card.oracle.scenarios} twins")
    for who, edge in card.boundaries.items():
        at = ", ".join(f"{name} = {value:.4g}" for name, value in edge.values.items())
        table.add_row(f"boundary of {who}", edge.words + (f", where {at}" if at else ""))
    if card.why_no_path:
        table.add_row("boundary", card.why_no_path)
    table.add_row("energy distance of features", f"{card.energy} [training ranges]")
    table.add_row("of moved parameters", f"{card.energy_of_parameters} [training ranges]")
    return table
