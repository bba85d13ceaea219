"""Writes docs/paper.md: the decisions of each task where the paper is silent, and its differences. `make docs`

The text is taken from the docstrings of the families: everything after the paragraph that begins with "Bottleneck".
"""

import ast
import inspect
import re
import sys
from pathlib import Path

from scengen import list_tasks, load_task
from scengen.samplers.task import Task

PAGE = Path(__file__).parent.parent / "docs" / "paper.md"
HEAD = """# Differences from the paper

The paper ([sources](../CONTRIBUTING.md#sources)) describes most tasks in a few sentences, gives few numbers, and
contradicts itself in places. Each task states its decisions, and its differences from the paper, in the docstring
of its family. `tools/paper_page.py` collects them here.

Decisions that hold for all tasks:

* Some tasks of the paper list two arms of which one is frozen. These tasks have one arm here, because the frozen
  arm would only add unused dimensions.
* Goals that the paper describes in words have numbers here, and a goal must hold for some time: `HOLD` of the family.
* If a plan avoids what the paper says the task is about, the task closes it: by physics where possible, otherwise
  by a rule that ends the episode. The paper has few such rules.
* The paper's eight OOD conditions (App. I) are axes of their tasks (`scengen tasks axes=paper`). All other axes are
  ours or follow another statement of the paper; each names its source.
* MuJoCo is 3.5 and robosuite is 1.5.2 (the paper: 3.1.2 and 1.5). Certificates name the versions for which they hold.
"""


def page() -> str:
    """The whole page."""
    tasks = sorted(map(load_task, list_tasks()), key=lambda task: (task.category == "M", task.category, task.code))
    seen: set[str] = set()
    parts = []
    for task in tasks:
        text = decisions(task)
        told = text if text not in seen else f"As {next(t.name for t in tasks if decisions(t) == text)}."
        seen.add(text)
        parts.append(f"\n## {task.code} [{task.name}](tasks/{task.name}.md)\n\n{told}\n")
    return HEAD + "".join(parts)


def decisions(task: Task) -> str:
    """Text after the bottleneck in the docstring of a family, as Markdown."""
    text = ast.get_docstring(ast.parse(Path(inspect.getfile(task.family)).read_text())) or ""
    found = re.search(r"^Bottleneck.*?\n\n", text, re.M | re.S)
    if found is None or not text[found.end() :].strip():
        sys.exit(f"{task.name}: its docstring has no decisions after a paragraph that begins with Bottleneck")
    return text[found.end() :].strip()


if __name__ == "__main__":
    PAGE.write_text(page())
    print(f"wrote {PAGE}")
