"""The card of every axis of every task, and docs/axes.md with a line for each. `python tools/all_axes.py n=50 [task]`

Cards are stored in generated/axes. A repeated call continues, and finished cards are read again. Axes without a card
keep their line. `python tools/all_axes.py page` only writes the page, with the figures of conf/certified.yaml.
"""

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from scengen import cli, list_tasks, load_task, task_files
from scengen.analysis.distance import Energy
from scengen.ood.axis_card import NOT_SEARCHED
from scengen.validate.certify import lower_bound

PAGE = Path(__file__).parent.parent / "docs" / "axes.md"
HEAD = """# Every split, measured

Written by `make axes` and `make docs`. The figures of certification are those of conf/certified.yaml, which
`tools/certified.py` measures:

* **certified**: scenarios certified at level `quick`, of the first draws. The rejected ones are listed at the end.
* **oracle**: other draws that the oracle solves without jitter, and the one-sided 95 % Clopper-Pearson bound of its
  success rate.
* **robosuite**: witnesses with the same verdict in robosuite, of those replayed there.
* **CPU s**: CPU time per certified scenario, rejected draws included, with all cores of the machine busy.

## Training

{training}
## Axes

Each line summarizes one axis card (`scengen probe`); each column states its sample size.

* **outside**: smallest gap between axis and training over the moved parameters [widths of the training range].
  **physics**: features declared by the family that leave training (sampled, 300 draws).
* **verdict**: the strongest memory that the axis breaks, *solved by memory*, or *inconclusive*. The four columns after
  it show, for each memory, how many of its control scenarios within training and how many OOD twins it solves, and the
  excess with its 95 % interval.
  **replay**: the actions that solve the training twin. **object-centric**: its path relative to the bodies that the
  hand goes to, followed by feedback. **any**: one of 16 training solutions, none of them the twin's own. The control is
  the remembered scenario with the axis' own parameters redrawn within training. For **any**, and if training has one
  value only (marked *held out*), it is a training scenario that no memory comes from. Only twins count that the oracle
  solves in both arms. `weak`: the memory solves less than 30 % of its control, and is inconclusive.
  *solved by memory*: some memory solves most of the axis, so that only vision can be tested there, if anything. In a
  task with a choice (`domino_select`) the memory of the twin contains the answer: an axis that makes the choice harder
  to see cannot break it. Use `scengen evaluate` to measure whether a policy still chooses correctly.
* **replay ends**, **oracle ends**: the first point of the path at which half of the twins or fewer are solved; 0 is
  the edge of training, 1 the far end of the axis. The 95 % interval in brackets assumes no curve; the point before it
  is a guess. `> x`: not before x; if x is the end of the path, with the number of twins solved there. `< 0`: the replay
  fails as soon as its scene's own value is exchanged for the nearest end of training. Holes shorter than a tenth of the
  axis, and beyond 1 shorter than half their distance from 0, may be missed.
* **energy**: energy distance between the features of the twins [training ranges], its value by chance, and the p value
  of a test that exchanges twins; `equal` if the axis moves no feature.

{axes}
## Rejected draws

{lost}
"""
"""The page, with places for its tables."""
CERTIFIED = ("certified", "oracle", "robosuite")
"""Titles of the figures of certification."""
COLUMNS = (
    *("task", "axis", "outside", "physics", *CERTIFIED, "verdict"),
    *("replay", "any replay", "object-centric", "any object-centric"),
    *("replay ends", "oracle ends", "energy"),
)
"""Titles of the table of axes."""


def main(*arguments: str) -> None:
    """Make all cards, or those of some tasks, and write the page."""
    if arguments == ("page",):
        PAGE.write_text(page())
        return
    settings = [argument for argument in arguments if "=" in argument]
    tasks = [argument for argument in arguments if "=" not in argument]
    failed = []
    for task in tasks or list_tasks():
        for axis in load_task(task).axes:
            if cli.run(("probe", f"task={task}", f"axis={axis}", "workers=2", *settings)):
                failed.append(f"{task}/{axis}")
    PAGE.write_text(page())
    sys.exit(f"no card of {', '.join(failed)}" if failed else 0)


def page() -> str:
    """The whole page."""
    told = task_files.certified()
    training = [
        [f"[{task}](tasks/{task}.md)", *_certification(found), f"{found['cpu']:.1f}" if found else "not measured"]
        for task in list_tasks()
        for found in [told.get(task, {}).get(task_files.ID, {})]
    ]
    lost = [
        f"* {task}, {split}: {times} {reason}"
        for task in list_tasks()
        for split, found in told.get(task, {}).items()
        for reason, times in found.get("lost", {}).items()
    ]
    return HEAD.format(
        training=_table(("task", *CERTIFIED, "CPU s"), training),
        axes=_table(COLUMNS, _axes(told)),
        lost="\n".join(lost),
    )


def _axes(told: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """The cells of each axis, in the order of the task files. An axis without a card keeps those of the page."""
    written = _written()
    rows = []
    for task in list_tasks():
        for axis in load_task(task).axes:
            path = PAGE.parent.parent / f"generated/axes/{task}-{axis}/card.json"
            cells = _of_card(json.loads(path.read_text())) if path.is_file() else written.get((task, axis), {})
            figures = dict(zip(CERTIFIED, _certification(told.get(task, {}).get(axis, {})), strict=True))
            known = {"task": task, "axis": axis, **cells, **figures}
            rows.append([known.get(title, "no card") for title in COLUMNS])
    return rows


def _written() -> dict[tuple[str, str], dict[str, str]]:
    """The cells of each axis on the page, by title."""
    lines = PAGE.read_text().splitlines() if PAGE.is_file() else []
    rows = [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in lines if line.startswith("| ")]
    titles: list[str] = []
    found = {}
    for row in rows:
        if row[:2] == list(COLUMNS[:2]):
            titles = row
        elif titles and len(row) == len(titles):
            found[row[0], row[1]] = dict(zip(titles, row, strict=True))
    return found


def _certification(found: Mapping[str, Any]) -> list[str]:
    """The figures of certification of a split."""
    if "draws" not in found:
        return ["not measured"] * len(CERTIFIED)
    oracle = f"{found['solved']} of {found['draws']} (> {100 * lower_bound(found['solved'], found['draws']):.0f}%)"
    same = f"{found['same']} of {found['replays']}" if found.get("replays") else "-"
    return [f"{found['certified']} of {found['indices']}", oracle, same]


def _of_card(card: dict[str, Any]) -> dict[str, str]:
    """The cells of a card, by title."""
    gaps = [p["relative"] for p in card["proofs"] if p["relative"]]
    leaving = [d["feature"] for d in card["features"] if d["inside"] == 0]
    cells = [
        card["task"],
        card["axis"],
        f"{min(gaps):.2g}" if gaps else "another value",
        ", ".join(leaving) or "stays",
        card["verdict"].replace("_", "-").replace("any-", "any "),
        *map(_baseline, card["baselines"]),
        _boundary(card, "replay"),
        _boundary(card, "oracle"),
        str(Energy(**card["energy"])),
    ]
    return dict(zip([title for title in COLUMNS if title not in CERTIFIED], cells, strict=True))


def _table(titles: Sequence[str], rows: Iterable[Iterable[str]]) -> str:
    lines = (titles, ["---"] * len(titles), *rows)
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def _baseline(baseline: dict[str, Any]) -> str:
    if not baseline["excess"]:
        return baseline["finding"]
    n, lost = baseline["excess"]["twins"], baseline["excess"]
    solved = [round(baseline[arm]["value"] * n) for arm in ("training", "here")]
    held_out = ", held out" if baseline["control"].startswith("held") and not baseline["name"].startswith("any") else ""
    weak = "weak, " if baseline["finding"] == "too weak" else ""
    how = f"{lost['value']:+.2f} [{lost['low']:.2f}, {lost['high']:.2f}]"
    return f"{weak}{solved[0]} → {solved[1]} of {n}, {how}{held_out}"


def _boundary(card: dict[str, Any], who: str) -> str:
    if card["why_no_path"]:
        return "not searched" if card["why_no_path"] == NOT_SEARCHED else "separate values"
    found = card["boundaries"][who]
    return found["told"] + "".join(f", {name} {value:.3g}" for name, value in found["values"].items())


if __name__ == "__main__":  # worker processes import this file again
    main(*sys.argv[1:])
