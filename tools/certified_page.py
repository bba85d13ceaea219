"""Writes docs/certified.md, the results of certification by task and split, from conf/certified.yaml. `make docs`"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scengen import list_tasks, task_files
from scengen.validate.certify import lower_bound

PAGE = Path(__file__).parent.parent / "docs" / "certified.md"
HEAD = """# Every split, certified

Written by `make docs` from conf/certified.yaml, which holds the measurements of `tools/certified.py`.

* **certified**: scenarios certified at level `quick`, of the first draws. The rejected ones are listed below the table.
* **oracle**: other draws that the oracle solves without jitter, and the one-sided 95 % Clopper-Pearson bound of its
  success rate.
* **robosuite**: witnesses with the same verdict in robosuite, of those replayed there.
* **CPU s**: CPU time per certified scenario, rejected draws included, with all cores of the machine busy. Rows
  without an oracle figure are older: they were measured on one core of an idle machine, with the conjugate-gradient
  solver.

| task | split | certified | oracle | robosuite | CPU s |
|---|---|---|---|---|---|
"""


def page() -> str:
    """The page as Markdown."""
    told, lost = task_files.certified(), []
    lines = []
    for name in list_tasks():
        for split, found in told.get(name, {}).items():
            lines.append(_line(f"[{name}](tasks/{name}.md)", split, found))
            lost += [f"* {name}, {split}: {times} {reason}" for reason, times in found.get("lost", {}).items()]
    return HEAD + "\n".join(lines) + "\n\n## Rejected draws\n\n" + "\n".join(lost) + "\n"


def _line(task: str, split: str, found: Mapping[str, Any]) -> str:
    certified = f"{found['certified']} of {found['indices']}"
    oracle = same = "-"
    if draws := found.get("draws"):
        solved = found["solved"]
        oracle = f"{solved} of {draws} (> {100 * lower_bound(solved, draws):.0f}%)"
    if played := found.get("replays"):
        same = f"{found['same']} of {played}"
    return f"| {task} | {split} | {certified} | {oracle} | {same} | {found['cpu']:.1f} |"


if __name__ == "__main__":
    PAGE.write_text(page())
    print(f"wrote {PAGE}")
