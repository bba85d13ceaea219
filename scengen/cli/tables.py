"""Tables of runs, pools, tasks and axes for the terminal."""

import json
from collections.abc import Mapping, Sequence
from itertools import islice, zip_longest
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from ..attack.campaign import AttackReport
from ..attack.evidence import TierRate, spelled
from ..certificate import STAGES
from ..evidence import ledger
from ..evidence.ledger import Evidence
from ..pool import Pool, PoolRow
from ..pool.demonstrations import POLICY, SCRIPTED, TELEOP, Demonstrations
from ..pool.row import DemonstrationRow
from ..runs.generate import Summary
from ..samplers.axis import Axis, spell
from ..samplers.dists import Fixed
from ..samplers.task import ID, Task
from ..samplers.task_files import About
from ..work.printed import width
from .certificates import certificate_table

LINES = 1000
"""Largest number of scenarios in a table of a pool; id= finds the others."""


def plain_table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """A table without lines between columns, so that it fits 80 columns. Its title stays in one line where it can."""
    least = min(len(title), width() or len(title))
    table = Table(*head, title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False, min_width=least)
    for row in rows:
        table.add_row(*row)
    return table


def funnel_table(funnel: Mapping[str, int], reasons: Mapping[str, int]) -> Table:
    """The rejection report: number of draws after each step, and the reasons of rejections."""
    table = Table("step", "left", "lost", "share", title="rejection report", title_justify="left")
    before = None
    for stage in ("proposed", *STAGES):
        count = funnel[stage]
        lost = "" if before is None or before == count else str(before - count)
        table.add_row(stage, str(count), lost, f"{count / max(1, funnel['proposed']):.0%}")
        before = count
    if reasons:
        table.add_section()
        for reason, count in sorted(reasons.items(), key=lambda item: -item[1])[:8]:
            table.add_row(in_words(reason), "", str(count), "", style="dim")
    return table


def in_words(reason: str) -> str:
    """A reason of the rejection report, in which `#` stands for numbers that differ, as people read it."""
    return reason.replace("# of #", "too few").replace("#", "N")


def summary_lines(summary: Summary) -> list[str]:
    """Summary of a run in a few lines."""
    n, indices = summary.certified, summary.indices
    pool = summary.pool
    lines = [
        f"{pool.folder}: {n} certified of {indices} indices",
        f"first draws certified: {summary.first_draws} of {indices} ({summary.first_draws / max(1, indices):.0%})",
    ]
    if n:
        lines.append(f"processor time per certified scenario: {summary.cpu / n:.1f} s")
    return [*lines, f"pool sha256: {pool.sha256}"]


def attack_table(report: AttackReport) -> Table:
    """Hit rate of each tier of the adversary."""
    table = Table("tier", "actions", title=f"attack on {report.task}", title_justify="left")
    for column in ("rollouts", "hits", "rate", "95 % bound", "refuting"):
        table.add_column(column, justify="right")
    for rate in report.rates:
        table.add_row(*_rate_cells(rate))
    return table


def _rate_cells(rate: TierRate) -> list[str]:
    """Cells of one line of the table."""
    kind, counts = spelled(rate.raw), (str(rate.rollouts), str(rate.hits))
    return [rate.tier, kind, *counts, f"{rate.value:.1%}", f"< {rate.bound:.1%}", str(rate.refuting or "")]


def pool_table(pool: Pool) -> Table:
    """One line per scenario, at most `LINES`, with the parameters that differ between scenarios, or of one alone with
    those that training draws."""
    rows = list(islice(zip(pool.names(), pool.columns("shifted", "params"), strict=True), LINES))
    every = [params for _, (_, params) in rows]
    drawn = [name for name in (every[0] if every else ()) if any(params[name] != every[0][name] for params in every)]
    if len(every) == 1:
        drawn = [*pool.manifest.task_node["id"]]
    table = Table(title=f"{pool.folder}: {pool.split}", title_justify="left")
    table.add_column("scenario", no_wrap=True)  # users copy names
    table.add_column("parameters")
    for called, (shifted, params) in rows:
        shown = [name for name in params if name in drawn or name in shifted]
        table.add_row(str(called), ", ".join(f"{name}={params[name]:.4g}" for name in shown))
    if len(pool) > len(rows):
        table.title = f"{table.title}: the first {len(rows)} of {len(pool)} scenarios"
    return table


def nature(source: Demonstrations) -> str:
    """What a folder of demonstrations holds, in one line."""
    about = source.manifest
    task, solved = f"{about.config.task['name']}/{about.config.split}", sum(shard.rows for shard in about.shards)
    failed = about.failed.rows if about.failed else 0
    changed = f" under {about.condition}" if about.condition else ""
    whose = {
        SCRIPTED: f"demonstrations of {task} by the oracle",
        TELEOP: f"demonstrations of {task} by person {about.operator}",
        POLICY: f"kept rollouts of policy {about.policy} on {task}{changed}",
    }[about.source]
    lost = f", {failed} that failed" if about.failed else ", failed ones not kept"
    return f"{source.folder}: {whose}, {about.config.rules} rules: {solved} successes{lost}"


def runs_table(source: Demonstrations) -> Table:
    """One line for each scenario of demonstrations, at most `LINES`, with its kept runs and why some failed."""
    runs = dict[str, list[DemonstrationRow]]()
    for row in source.attempts():
        runs.setdefault(str(row.name), []).append(row)
    table = Table("scenario", "runs", "solved", "failed because")
    table.columns[0].no_wrap = True  # users copy names
    for name, rows in islice(runs.items(), LINES):
        reasons = dict.fromkeys(row.reason for row in rows if row.reason)
        solved = sum(row.outcome == "success" for row in rows)
        table.add_row(name, str(len(rows)), str(solved), "; ".join(reasons))
    return table


def pools_table(pools: Sequence[Pool]) -> Table:
    """One line for each of many pools."""
    table = Table("pool", "code", "split", "scenarios", "proposed", title_justify="left")
    for pool in pools:
        codes = ", ".join(sorted(pool.kinds("code")[0]))
        table.add_row(str(pool.folder), codes, pool.split, str(len(pool)), str(pool.manifest.funnel["proposed"]))
    table.title = f"{len(pools)} pools, {sum(map(len, pools))} scenarios"
    return table


def scenario_tables(row: PoolRow) -> list[Table]:
    """Tables of one scenario: its identity, its parameters and its certificate."""
    about = Table(title=str(row.name), title_justify="left", show_header=False)
    about.add_column("", no_wrap=True)
    about.add_column("")
    for name in ("instruction", "split", "seed", "index", "attempt", "id_twin", "embodiment", "scene_sha256"):
        about.add_row(name, str(getattr(row, name)))
    about.add_row("shifted", _numbers(row.shifted))
    about.add_row("witness", f"{len(row.witness)} control periods of 10 ms, sha256 {row.witness_sha256[:16]}...")
    params = Table("parameter", "value", title="parameters", title_justify="left")
    for name, value in row.params.items():
        params.add_row(name, f"{value:g}")
    return [about, params, certificate_table(row)]


def tasks_table(tasks: Sequence[About], certified: Mapping[str, Mapping[str, Evidence]]) -> Table:
    """One line for each task.

    Args:
        tasks: tasks, grouped by category.
        certified: results of certification by task and split.
    """
    table = Table(title=f"{len(tasks)} tasks", title_justify="left")
    for column in ("", "code", "task", "hands"):
        table.add_column(column, no_wrap=True)
    for column in ("axes", "certified", "CPU s"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("instruction")
    for task, after in zip_longest(tasks, tasks[1:]):
        rows = certified[task.name]
        results = [row.value for row in rows.values()]
        old = "*" if any(map(ledger.mark, rows.values())) else ""
        counts = (sum(each[what] for each in results) for what in ("certified", "indices"))
        share = f"{' of '.join(map(str, counts))}{old}" if results else "-"
        each = f"{rows[ID].value['cpu']:.1f}" if ID in rows else "-"
        hands = task.embodiment.replace("panda_", "")
        cells = (task.name, hands, str(len(task.axes)), share, each, task.instruction)
        table.add_row(
            task.category, task.code, *cells, end_section=after is not None and after.category != task.category
        )
    table.caption = (
        "certified: of the tried draws; CPU s: for one certificate in training, level quick; "
        "*: measured on an earlier version of the task; -: not measured"
    )
    table.caption_justify = "left"
    return table


def task_tables(task: Task) -> list[Table]:
    """Tables of one task: parameters with unit, bounds and training range, and axes with their proofs."""
    params = Table("parameter", "unit", "bounds", "nominal", "training (id)", title=f"{task.code} {task.name}")
    for p in task.known.values():
        dist = task.training[p.name]
        spread = "" if dist == Fixed(p.nominal) else spell(dist)
        hidden = " (hidden)" if p.hidden else ""
        params.add_row(p.name + hidden, p.unit, f"{p.low:g} to {p.high:g}", f"{p.nominal:g}", spread)
    params.title_justify = "left"
    return [params, axes_table([(task, axis) for axis in task.axes.values()])]


def axes_table(axes: Sequence[tuple[Task, Axis]]) -> Table:
    """Axes with their proofs. If there are several tasks, the task of each axis is shown."""
    several = len({task.name for task, _ in axes}) > 1
    table = Table(*(["task"] if several else []), title="axes: each lies outside training", title_justify="left")
    for column in ("axis", "parameter", "training", "goes to", "gap", "proof", "why"):
        table.add_column(column)
    for task, axis in axes:
        names, why = [*([task.name] if several else []), axis.name], f"{axis.why} ({axis.source or 'no source'})"
        for proof in task.proofs[axis.name]:
            relative = f" = {proof.relative:.2g} training widths" if proof.relative else ""
            gap = f"{proof.gap:.3g} {task.known[proof.parameter].unit}{relative}"
            spread = [spell(dist[proof.parameter]) for dist in (task.training, axis.replace)]
            table.add_row(*names, proof.parameter, *spread, gap, proof.kind, why)
            names, why = [""] * len(names), ""  # shown once for all parameters of an axis
        table.add_section()
    return table


def _numbers(numbers: Mapping[str, Any]) -> str:
    return json.dumps(numbers, default=str)[1:-1].replace('"', "")
