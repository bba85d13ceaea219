"""What to expect of a training: the learning curve that the ledger holds of the same task and policy."""

from collections import defaultdict
from statistics import mean

from ..evidence import ledger
from ..samplers.split import ID

STYLES = "mixed"
"""Name in the ledger of demonstrations in the default styles."""


def expected(task: str, policy: str) -> str:
    """A line about the scenarios that such policies solved, by their numbers of demonstrations.

    Args:
        task: name of the task.
        policy: kind of the policy.

    Raises:
        BadConfig: the ledger cannot be read.
    """
    rows = [row for row in ledger.newest("training", task) if row.split == ID and row.has(policy=policy, data=STYLES)]
    solved = defaultdict[int, list[int]](list)
    for row in rows:
        solved[row.made_with["size"]].append(row.value["solved"])
    if not solved:
        return f"what to expect of {policy} on {task} was not measured; docs/baselines.md has other tasks"
    curve = ", ".join(f"{mean(solved[size]):.3g} after {size}" for size in sorted(solved))
    return f"to expect: of {rows[0].n} training scenarios {policy} solved {curve} demonstrations{ledger.mark(rows[0])}"
