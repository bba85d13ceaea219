"""Play the cheats that people found, into records/cheat. docs/kept_cheats.md shows them.

    python tools/kept_cheats.py [TASK ...]

Each cheat of `tests/attack/hands` is played on the same draws of training in its task as it is and without its mend. A
repeated call continues. What the adversary finds by itself is told by `tests/attack/recall.py`.
"""

import importlib
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "attack"))

import mutation_score
from hand import Hand
from test_hands import HANDS, outcome

from scengen import load_task
from scengen.attack.campaign import GRAMMAR
from scengen.evidence import ledger, measuring
from scengen.samplers.split import ID

DRAWS = 12
"""Number of training draws."""
COLUMNS = ("task", "idea", "cheat", "solved", "without the mend", "the adversary finds")
"""Titles of the table of cheats."""
CLAUSES = (
    *("task", "left out", "exploited by a written cheat", "found by the adversary", "random", "varied runs flagged"),
)
"""Titles of the table of clauses."""


def main(*names: str) -> None:
    """Play what is missing."""
    for name, cheat in HANDS:
        task, made_with = load_task(name), {"cheat": cheat, "draws": DRAWS}
        if (names and name not in names) or measuring.measured(task, ID, "cheat", made_with):
            continue
        found = played(name, cheat)
        measuring.keep(task, ID, "cheat", DRAWS, found, made_with)
        print(f"{name} {cheat}: {found['closed']} of {DRAWS}, {found['open']} without its mend", flush=True)


def played(task: str, cheat: str) -> dict[str, int]:
    """How many draws a cheat solves in the task as it is, and without its mend."""
    return {
        name: [outcome(task, cheat, index, mended) for index in range(DRAWS)].count("success")
        for name, mended in (("closed", True), ("open", False))
    }


def fills() -> dict[str, str]:
    """The tables of docs/kept_cheats.md."""
    return {"cheats": _table(COLUMNS, rows()), "clauses": _table(CLAUSES, clauses())}


def _table(titles: Sequence[str], lines: Iterable[str]) -> str:
    return "".join(f"{line}\n" for line in (f"| {' | '.join(titles)} |", "|---" * len(titles) + "|", *lines))


def clauses() -> Iterator[str]:
    """The rows of the table of clauses, and their sums."""
    found = mutation_score.stored()
    for name in ("all", *sorted({row.task for row in found})):
        of = [row for row in found if name in ("all", row.task)]
        mutants, varied = (
            [row.value for row in of if bool(row.made_with["mutant"]) is which] for which in (True, False)
        )
        exploited = [one for one in mutants if one["cheats"]]
        counts = [sum(bool(one[what]) for one in exploited) for what in ("found", "random")]
        runs, flagged = (sum(one[what] for one in varied) for what in ("runs", "flagged"))
        flags = f"{flagged} of {runs}" if runs else "-"
        row = (name, len(mutants), len(exploited), *counts, flags)
        yield f"| {' | '.join(map(str, row))} |"


def rows() -> Iterator[str]:
    """The rows of the table."""
    last = ""
    for (task, cheat), hand in HANDS.items():
        number, _, idea = str(importlib.import_module(f"hands.{task}").__doc__).partition(":")
        name = f"{number} [{task}](tasks/{task}.md)" if task != last else ""
        found = next((row.value for row in ledger.current("cheat", task) if row.has(cheat=cheat, draws=DRAWS)), None)
        none = ledger.not_measured(task)
        counts = [f"{found[part]} of {DRAWS}" for part in ("closed", "open")] if found else [none] * 2
        plan = cheat.removesuffix("_raw").replace("_", " ") + (", raw" if hand.raw else "")
        idea = " ".join(idea.split()) if task != last else ""
        yield f"| {' | '.join((name, idea, plan, *counts, found_by(task, hand)))} |"
        last = task


def found_by(task: str, hand: Hand) -> str:
    """The tiers that find a way without a cheat's mend. Cheats with the same mend share them."""
    mended = {cheat for (name, cheat), other in HANDS.items() if name == task and other.unmended == hand.unmended}
    rows = [row for row in ledger.current("recall", task) if row.has(grammar=GRAMMAR)]
    found = next((row.value["found"] for row in rows if row.made_with["cheat"] in mended), None)
    return ledger.not_measured(task) if found is None else found.partition(":")[0] or "nothing"


if __name__ == "__main__":
    main(*sys.argv[1:])
