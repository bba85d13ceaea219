"""The tables of an evaluation in LaTeX, in the layouts of the paper: by category, by task, and every split."""

from collections.abc import Iterator, Mapping, Sequence

from ..samplers.split import ID
from .rows import ALL_AXES, Row, count
from .statistics import Difference, Rate

FILE = "table.tex"
"""File with the tables."""
SPECIAL = {"\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
"""Characters that LaTeX reads as commands, with their replacements; others get a backslash."""

Rows = Mapping[tuple[str, str, str, str], Row]
"""Rows by policy, task or category, split and condition."""
STARS = "; *: differs significantly from training, or under a condition from the clean episodes (95 \\%)"
"""End of the caption of a table with stars."""


def latex(rows: Sequence[Row], category: Mapping[str, str]) -> str:
    """Tables for `booktabs`: success by category, in and out of distribution by task, and every row.

    Args:
        rows: rows of all policies.
        category: category of each task.
    """
    found = {(row.policy, row.task, row.split, row.condition): row for row in rows}
    policies = list(dict.fromkeys(row.policy for row in rows))
    groups = list(dict.fromkeys(category.values()))
    grouped, of_tasks = _by_category(found, policies, category), _by_task(found, policies, category)
    every = ["task", "split", "condition", "policy", "n", "success"]
    tables = [
        booktabs("Success in training by category [\\%]", ["policy", *groups, "all"], grouped),
        booktabs(f"Success in and out of distribution [\\%]{STARS}", ["task", *_twice(policies)], of_tasks),
        booktabs(f"Success on every split and condition [\\%]{STARS}", every, _every(rows)),
    ]
    return "% needs \\usepackage{booktabs}; intervals are 95 %\n" + "\n".join(tables)


def _by_category(rows: Rows, policies: Sequence[str], category: Mapping[str, str]) -> Iterator[list[str]]:
    """A row for each policy. A category of one task has the rate of that task."""
    names = list(dict.fromkeys(category.values()))
    members = {name: [task for task, own in category.items() if own == name] for name in names}
    keys = [members[name][0] if len(members[name]) == 1 else name for name in names]
    whole = keys[0] if len(keys) == 1 else "all"
    for policy in policies:
        yield [policy, *(_cell(rows.get((policy, key, ID, ""))) for key in (*keys, whole))]


def _by_task(rows: Rows, policies: Sequence[str], category: Mapping[str, str]) -> Iterator[list[str]]:
    """A row for each task: of each policy the rates in training and over all axes."""
    for task in category:
        found = [task]
        for policy in policies:
            splits = [split for p, what, split, condition in rows if (p, what, condition) == (policy, task, "")]
            outside = [split for split in splits if split != ID]
            last = ALL_AXES if ALL_AXES in outside else outside[0] if outside else ""
            found += [_cell(rows.get((policy, task, split, ""))) for split in (ID, last)]
        yield found


def _every(rows: Sequence[Row]) -> Iterator[list[str]]:
    for row in rows:
        n = count(row.rate).replace("x", "$\\times$")
        yield [row.task, row.split, row.condition or "clean", row.policy, n, _cell(row)]


def _twice(policies: Sequence[str]) -> list[str]:
    return [f"{policy}, {side}" for policy in policies for side in ("ID", "OOD")]


def _cell(row: Row | None) -> str:
    return cell(row.rate, row.difference) if row else cell(None)


def cell(rate: Rate | None, difference: Difference | None = None) -> str:
    """A rate with its interval below the line, in percent, as LaTeX; a star if its difference is significant."""
    if rate is None:
        return "--"
    value, low, high = (100 * each for each in (rate.value, rate.low, rate.high))
    star = "^{*}" if difference and difference.is_significant else ""
    return f"${value:.1f}{star}_{{[{low:.0f},\\,{high:.0f}]}}$"


def booktabs(caption: str, head: Sequence[str], rows: Iterator[list[str]]) -> str:
    """A table; cells with a dollar sign are LaTeX already."""
    body = [" & ".join(cell if "$" in cell else _escaped(cell) for cell in row) + " \\\\" for row in rows]
    titles = " & ".join(map(_escaped, head)) + " \\\\"
    columns = f"\\begin{{tabular}}{{{'l' * len(head)}}}"
    lines = ["\\begin{table}", "\\centering", f"\\caption{{{caption}}}", columns, "\\toprule"]
    return "\n".join([*lines, titles, "\\midrule", *body, "\\bottomrule", "\\end{tabular}", "\\end{table}", ""])


def _escaped(text: str) -> str:
    return "".join(SPECIAL.get(c, f"\\{c}" if c in "#$%&_" else c) for c in text)
