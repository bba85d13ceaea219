"""The card of every axis of every task, and docs/axes.md with a line for each. `python tools/all_axes.py 50 [task ...]`

Cards stand in generated/axes; a repeated call continues, and cards that are finished are read again. Axes without a
card keep the line that they have.
"""

import json
import sys
from pathlib import Path
from typing import Any

from scengen import cli, config
from scengen.analysis.distance import Energy
from scengen.ood.behaviour import EXTRAPOLATION
from scengen.ood.boundary import FAILS_AT_ONCE, HOLDS

PAGE = Path("docs/axes.md")
HEAD = """# Every axis, measured

Written by `make axes`; each line sums up one axis card (`scengen axis`): {n} twins, certificates with certify=quick.

* **outside**: least gap between axis and training over the parameters that it moves [widths of the training range];
  **physics**: which of the features that the family declares leave training (sampled, 300 draws).
* **certified**: of how many indices. **true extrapolation**: twins in which the witness of the training twin fails and
  the oracle succeeds, with Wilson's 95 % interval; **else**: the others. On a cosmetic axis open-loop replay suffices:
  it asks for no new motion, and perception is not tested.
* **replay**, **oracle**: where on the path success falls to 50 %; 0 is the edge of training, 1 the far end of the axis,
  in brackets the 95 % credible interval; `> x`: it holds to the end of the path. `at the edge`: the replay fails as
  soon as its scene's own value is exchanged for the nearest end of training.
* **energy**: energy distance between the features of the twins [training ranges], what chance gives, and the p value of
  a test that exchanges twins; `equal` where the axis moves no feature.

| task | axis | outside | physics | certified | true extrapolation | else | replay | oracle | energy |
|---|---|---|---|---|---|---|---|---|---|
"""


def main(n: str, *tasks: str) -> None:
    """Make all cards, or those of some tasks, and write their lines."""
    failed = []
    for task in tasks or config.tasks():
        for axis in config.task(task).axes:
            if cli.run(("axis", f"task={task}", f"axis={axis}", f"n={n}", "workers=2")):
                failed.append(f"{task}/{axis}")
    PAGE.write_text(HEAD.format(n=n) + "".join(_lines()))
    sys.exit(f"no card of {', '.join(failed)}" if failed else 0)


def _lines() -> list[str]:
    """A line for each card, in the order of the task files; where there is no card, the line that the page has."""
    written = PAGE.read_text().splitlines(keepends=True) if PAGE.is_file() else []
    lines = []
    for task in config.tasks():
        for axis in config.task(task).axes:
            path = Path(f"generated/axes/{task}-{axis}/card.json")
            if path.is_file():
                lines.append(_line(json.loads(path.read_text())))
            else:
                lines += [line for line in written if line.startswith(f"| {task} | {axis} |")]
    return lines


def _line(card: dict[str, Any]) -> str:
    gaps = [p["relative"] for p in card["proofs"] if p["relative"]]
    leaving = [d["feature"] for d in card["features"] if d["inside"] == 0]
    share = next(s for s in card["behaviour"] if s["kind"] == EXTRAPOLATION)
    cells = [
        card["task"],
        card["axis"],
        f"{min(gaps):.2g}" if gaps else "another value",
        ", ".join(leaving) or "stays",
        f"{card['funnel']['certified']} of {card['indices']}",
        f"{share['count']} ({share['low']:.0%} to {share['high']:.0%})",
        ", ".join(f"{s['count']} {s['kind']}" for s in card["behaviour"] if s["count"] and s is not share),
        _boundary(card, "replay"),
        _boundary(card, "oracle"),
        str(Energy(**card["energy"])),
    ]
    return f"| {' | '.join(cells)} |\n"


def _boundary(card: dict[str, Any], who: str) -> str:
    if card["why_no_path"]:
        return "separate values"
    found = card["boundaries"][who]
    if found["verdict"] == HOLDS:
        return f"> {found['end']:.2f}"
    if found["verdict"] == FAILS_AT_ONCE:
        return "at the edge"
    at = "".join(f", {name} {value:.3g}" for name, value in found["values"].items())
    return f"{found['middle']:.2f} [{max(found['low'], 0):.2f}, {found['high']:.2f}]{at}"


if __name__ == "__main__":  # worker processes import this file again
    main(*sys.argv[1:])
