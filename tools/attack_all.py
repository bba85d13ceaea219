"""Attack every task, and docs/attacks.md with a line for each. `python tools/attack_all.py 500 [task ...]`

Reports stand in records/attacks, hits in generated/attack; a repeated call continues. Tasks that were never attacked have
no line.
"""

import json
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from scengen import cli, list_tasks
from scengen.attack.evidence import TierRate

SCENARIOS, SEED = 10, 4242
FOLDER = Path("records/attacks")
PAGE = Path("docs/attacks.md")
HEAD = f"""# Every task, attacked

Written by `make attacks`: what the built-in adversary (`scengen attack`) came to on {SCENARIOS} training scenarios of
each task, every plan both through the teleoperation filter and raw. It knows nothing of a task but its bodies, a
witness, and what the family says is asked for.

* **random**: one to five random moves from the start (pick, push, place, press, turn, shake, throw, wait). **foreign**:
  witnesses of the other scenarios. **shortcuts**: the declared ones, alone and in sequence. Each with its hits of
  rollouts and the one-sided 95 % Clopper-Pearson bound of the rate.
* **retries**: one move repeated while a height, a tilt, a place or a direction is swept, often from where the own
  witness has come to. **own**: that witness with a phase dropped, repeated, mirrored, slowed or quickened, and a search
  that goes on from its states. Whoever is given the solution may well solve the rest: these look for ways around, and
  their rates bound nothing.
* **1, 2, 3 fixed**: the best fixed answers (a lane, a share of a height), fitted on 300 other draws, given one after
  the other without looking: share of fresh draws that they solve, and its bound. "-" where what is asked for is no
  number, or where a wrong answer ends the episode.
* **refuting**: hits that lack a contact which the oracle has in its witness and in forty varied runs: a way around the
  task. There may be none; whoever finds one, please tell us. (The three of `ramp_sort` are its own witness played
  faster: two balls do not meet in their bin.)

The adversary is told where the bodies are, as no policy is in `mirror_pick_place`: a random pick at the right place is
all that is asked for there, and its share says nothing of a policy that sees a mirrored picture.

| task | random | foreign | shortcuts | 1 fixed | 2 fixed | 3 fixed | retries | own | rollouts | refuting |
|---|---|---|---|---|---|---|---|---|---|---|
"""


def main(budget: str, *tasks: str) -> None:
    """Attack all tasks, or some, and write their lines."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    refuted = []
    for task in tasks or list_tasks():
        target = FOLDER / f"{task}.json"
        argv = (f"task={task}", f"n={SCENARIOS}", f"budget={budget}", f"seed={SEED}", "workers=2", f"json={target}")
        if cli.run(("attack", *argv)):
            refuted.append(task)
        report = json.loads(target.read_text())
        report["hits"] = [hit for hit in report["hits"] if hit["refutes"]]
        target.write_text(json.dumps(report, indent=1, sort_keys=True) + "\n")
    told = [path for task in list_tasks() if (path := FOLDER / f"{task}.json").is_file()]
    PAGE.write_text(HEAD + "".join(line(json.loads(path.read_text())) for path in told))
    sys.exit(f"refuted, or not attacked: {', '.join(refuted)}" if refuted else 0)


def line(report: Mapping[str, Any]) -> str:
    """One task in the table."""
    blind, given = (("random",), ("foreign",), ("shortcut",)), (("retry",), ("witness", "search"))
    fixed = {len(prior["values"]): _share(prior) for prior in report["priors"]}
    cells = [
        report["task"],
        *(_counted(rate for rate in report["rates"] if rate["tier"] in names) for names in blind),
        *(fixed.get(count, "-") for count in (1, 2, 3)),
        *(_counted(rate for rate in report["rates"] if rate["tier"] in names) for names in given),
        str(report["rollouts"]),
        str(len(report["hits"])),
    ]
    return f"| {' | '.join(cells)} |\n"


def _counted(rates: Iterable[Mapping[str, Any]]) -> str:
    known = list(rates)
    total = TierRate("", False, sum(rate["rollouts"] for rate in known), sum(rate["hits"] for rate in known))
    return f"{total.hits} of {total.rollouts} (< {total.bound:.1%})" if total.rollouts else "-"


def _share(prior: Mapping[str, Any]) -> str:
    if prior["fresh"] is None:
        return f"{prior['fitted']:.1%} where fitted"
    return f"{prior['fresh']:.1%} (< {prior['bound']:.1%})"


if __name__ == "__main__":  # worker processes import this file again
    main(*sys.argv[1:])
