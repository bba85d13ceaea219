"""The card of every axis of every task, and docs/axes.md with a line for each. `python tools/all_axes.py n=50 [task]`

Cards are stored in generated/axes. A repeated call continues, and finished cards are read again. Axes without a card
keep their line.
"""

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from scengen import cli, list_tasks, load_task
from scengen.analysis.distance import Energy
from scengen.ood.axis_card import NOT_SEARCHED

PAGE = Path("docs/axes.md")
HEAD = """# Every axis, measured

Written by `make axes`. Each line summarizes one axis card (`scengen probe`); each column states its sample size.

* **outside**: smallest gap between axis and training over the moved parameters [widths of the training range].
  **physics**: features declared by the family that leave training (sampled, 300 draws).
* **certified**: number of certified scenarios, of how many indices.
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

{titles}
{rule}
"""
"""Text before the table, with places for its titles and rule."""
COLUMNS = (
    *("task", "axis", "outside", "physics", "certified", "verdict"),
    *("replay", "any replay", "object-centric", "any object-centric"),
    *("replay ends", "oracle ends", "energy"),
)
"""Titles of the table."""


def main(*arguments: str) -> None:
    """Make all cards, or those of some tasks, and write the page."""
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
    return HEAD.format(titles=_row(COLUMNS), rule=_row(["---"] * len(COLUMNS))) + "".join(_lines())


def _lines() -> list[str]:
    """A line for each card, in the order of the task files. An axis without a card keeps its line of the page."""
    written = PAGE.read_text().splitlines(keepends=True) if PAGE.is_file() else []
    lines = []
    for task in list_tasks():
        for axis in load_task(task).axes:
            path = Path(f"generated/axes/{task}-{axis}/card.json")
            if path.is_file():
                lines.append(_line(json.loads(path.read_text())))
            else:
                lines += [line for line in written if line.startswith(f"| {task} | {axis} |")]
    return lines


def _line(card: dict[str, Any]) -> str:
    gaps = [p["relative"] for p in card["proofs"] if p["relative"]]
    leaving = [d["feature"] for d in card["features"] if d["inside"] == 0]
    cells = [
        card["task"],
        card["axis"],
        f"{min(gaps):.2g}" if gaps else "another value",
        ", ".join(leaving) or "stays",
        f"{card['funnel']['certified']} of {card['indices']}" if card["indices"] else "not tried",
        card["verdict"].replace("_", "-").replace("any-", "any "),
        *map(_baseline, card["baselines"]),
        _boundary(card, "replay"),
        _boundary(card, "oracle"),
        str(Energy(**card["energy"])),
    ]
    return _row(cells) + "\n"


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


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
