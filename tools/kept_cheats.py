"""Play the cheats that people found, into records/cheat, and write docs/kept_cheats.md.

    python tools/kept_cheats.py [TASK ...]

Each cheat of `tests/attack/hands` is played on the same draws of training in its task as it is and without its mend. A
repeated call continues. With `page` alone, the tool only writes the page. What the adversary finds by itself is told by
`tests/attack/recall.py`.
"""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "attack"))

import mutation_score
from hand import Hand
from test_hands import HANDS, outcome

from scengen import load_task
from scengen.attack.campaign import GRAMMAR
from scengen.evidence import ledger, measuring
from scengen.samplers.split import ID

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "kept_cheats.md"
DRAWS = 12
"""Number of training draws."""
HEAD = f"""# Kept cheats

Written by `python tools/kept_cheats.py`. Every cheat was found by a person with the skills that oracles use, and reads
no hidden parameter. It is kept in `tests/attack/hands`, with the rule or the physics that closes it
([Attacking a task by hand](cheats.md)). Here each is played on {DRAWS} fresh training draws, in the task as it is and
without that mend, and through the filter unless stated otherwise. The last column is what the adversary finds without
the mend (`python tests/attack/recall.py`): the tier whose plan the closed task refuses, or, if the mend is one of
physics, the tiers that succeed more than twice as often as in the closed task.

| task | idea | cheat | solved | without the mend | the adversary finds |
|---|---|---|---|---|---|
"""
CLAUSES = """
## Rules and parts of goals, left out one at a time

Made by `python tools/mutation_score.py`. Clauses of rules and of goals are left out, and some values leave their
constraints. Then every cheat that somebody wrote for the task is played, declared shortcuts included. If one succeeds
because of it, the adversary attacks without shortcuts on ten scenarios until it finds such a way as well, with at most
500 rollouts, as in [every task, attacked](attacks.md). "Random" is what random macros find with as many. The last
column counts runs of the oracle with 1.5 times a certificate's jitter, in the whole task, that would be taken for a way
around it.

| task | left out | exploited by a written cheat | found by the adversary | random | varied runs flagged |
|---|---|---|---|---|---|
"""


def main(*names: str) -> None:
    """Play what is missing, and write the page."""
    for name, cheat in HANDS if names != ("page",) else ():
        task, made_with = load_task(name), {"cheat": cheat, "draws": DRAWS}
        if (names and name not in names) or measuring.measured(task, ID, "cheat", made_with):
            continue
        found = played(name, cheat)
        measuring.keep(task, ID, "cheat", DRAWS, found, made_with)
        print(f"{name} {cheat}: {found['closed']} of {DRAWS}, {found['open']} without its mend", flush=True)
    PAGE.write_text(page())
    print(f"wrote {PAGE.relative_to(ROOT)}")


def played(task: str, cheat: str) -> dict[str, int]:
    """How many draws a cheat solves in the task as it is, and without its mend."""
    return {
        name: [outcome(task, cheat, index, mended) for index in range(DRAWS)].count("success")
        for name, mended in (("closed", True), ("open", False))
    }


def page() -> str:
    """The page of all cheats."""
    return HEAD + "".join(f"{row}\n" for row in rows()) + CLAUSES + "".join(f"{row}\n" for row in clauses())


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
