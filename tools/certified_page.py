"""docs/certified.md: what certification came to, by task and split, from conf/certified.yaml. `make docs`"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scengen import config, task_files
from scengen.validate.certify import lower_bound

PAGE = Path(__file__).parent.parent / "docs" / "certified.md"
HEAD = """# Every split, certified

Written by `make docs` from conf/certified.yaml, where `tools/certified.py` puts what it measures.

* **certified**: at level `quick`, of the first draws. What became of the others stands below the table.
* **oracle**: other draws that the oracle solves without any disturbance, and the one-sided 95 % Clopper-Pearson bound
  of its rate.
* **robosuite**: witnesses with the same verdict in robosuite, of those played there.
* **CPU s**: processor time of each scenario that was certified, and of those lost on its way, with every core of the
  machine at work. Rows without an oracle are older: one core of an idle machine, and conjugate gradients.

| task | split | certified | oracle | robosuite | CPU s |
|---|---|---|---|---|---|
"""


def page() -> str:
    """The page as it has to be: Markdown."""
    told, lost = task_files.certified(), []
    lines = []
    for name in config.tasks():
        for split, found in told.get(name, {}).items():
            lines.append(_line(f"[{name}](tasks/{name}.md)", split, found))
            lost += [f"* {name}, {split}: {times} {reason}" for reason, times in found.get("lost", {}).items()]
    return HEAD + "\n".join(lines) + "\n\n## What was lost\n\n" + "\n".join(lost) + "\n"


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
