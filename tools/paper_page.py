"""docs/paper.md: what every task decides where the paper is silent, and where it differs from it. `make docs`

It is taken from the docstrings of the families: all that follows the paragraph about the bottleneck.
"""

import ast
import inspect
import re
import sys
from pathlib import Path

from scengen import config
from scengen.samplers.task import Task

PAGE = Path(__file__).parent.parent / "docs" / "paper.md"
HEAD = """# Where the tasks differ from the paper

The paper ([sources](../CONTRIBUTING.md#sources)) tells most tasks in a few sentences, gives few numbers, and
contradicts itself in places. What each task decides there, and where it leaves the paper, is written at the head of
its family, and gathered here by `tools/paper_page.py`.

What holds for all of them:

* Tasks that the paper lists with two arms of which one is frozen have one arm here: the other would add numbers that do
  nothing.
* Goals that the paper describes in words have numbers here, and what is reached must last: `HOLD` of the family.
* A way around what the paper says a task is about is closed, by physics where that is possible, else by a rule that
  loses the episode; the paper has few such rules.
* The eight OOD conditions of the paper (App. I) are axes of their tasks: `scengen tasks axes=paper`. All other axes are
  ours, or take up what the paper says elsewhere, and say so.
* MuJoCo is 3.5 and robosuite 1.5.2 (the paper: 3.1.2 and 1.5); certificates name the versions that they hold for.
"""


def page() -> str:
    """The whole page."""
    tasks = sorted(map(config.task, config.tasks()), key=lambda task: (task.category == "M", task.category, task.code))
    seen: set[str] = set()
    parts = []
    for task in tasks:
        text = decisions(task)
        told = text if text not in seen else f"As {next(t.name for t in tasks if decisions(t) == text)}."
        seen.add(text)
        parts.append(f"\n## {task.code} [{task.name}](tasks/{task.name}.md)\n\n{told}\n")
    return HEAD + "".join(parts)


def decisions(task: Task) -> str:
    """What follows the bottleneck in the docstring of a family, as Markdown."""
    text = ast.get_docstring(ast.parse(Path(inspect.getfile(task.family)).read_text())) or ""
    found = re.search(r"^Bottleneck.*?\n\n", text, re.M | re.S)
    if found is None or not text[found.end() :].strip():
        sys.exit(f"{task.name}: its docstring has no decisions after a paragraph that begins with Bottleneck")
    return text[found.end() :].strip()


if __name__ == "__main__":
    PAGE.write_text(page())
    print(f"wrote {PAGE}")
