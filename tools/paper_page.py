"""Decisions of each task where the paper is silent, and its differences, for docs/paper.md.

The text is taken from the docstrings of the families: everything after the paragraph that starts with "Bottleneck".
"""

import ast
import inspect
import re
import sys
import textwrap
from pathlib import Path

from scengen import list_tasks, load_task
from scengen.samplers.task import Task


def fills() -> dict[str, str]:
    """The decisions of all tasks."""
    tasks = sorted(map(load_task, list_tasks()), key=lambda task: (task.category[:1] != "P", task.category, task.code))
    seen: set[str] = set()
    parts = []
    for task in tasks:
        text = decisions(task)
        told = text if text not in seen else f"As {next(t.name for t in tasks if decisions(t) == text)}."
        seen.add(text)
        parts.append(f"\n## {task.code} [{task.name}](tasks/{task.name}.md)\n\n{told}\n{ending(task)}")
    return {"decisions": "".join(parts)}


def ending(task: Task) -> str:
    """What ends an episode of a task, as Markdown."""
    reasons = failures(task.family)
    kinds = {"Strict rules": True, "Other failures": False}
    lines = [
        f"{kind}: {'; '.join(of)}.\n"
        for kind, strict in kinds.items()
        if (of := [text for text, is_strict in reasons if is_strict == strict])
    ]
    return "\n" + "\n".join(lines) if lines else ""


def failures(family: type) -> list[tuple[str, bool]]:
    """Reasons of failures of a family, in the order in which they are judged, and whether each is strict."""
    found: list[tuple[str, bool]] = []
    seen = {"failure"}
    todo = ["failure"]
    for name in todo:  # grows by the methods that also give reasons
        for owner in family.__mro__:
            if name not in vars(owner) or owner.__module__ == "scengen.scenario":
                continue
            tree = ast.parse(textwrap.dedent(inspect.getsource(vars(owner)[name])))
            own, called = _reasons(tree)
            found += own
            todo += [other for other in called if other not in seen and _gives_reasons(family, other)]
            seen.update(called)
            if name != "failure" or not _calls_super(tree):
                break
    return list(dict.fromkeys(found))


def _reasons(tree: ast.AST) -> tuple[list[tuple[str, bool]], list[str]]:
    """Texts that a method returns, each with whether it is strict; and methods of the family that it returns."""
    texts, called = list[tuple[str, bool]](), list[str]()

    def look(node: ast.AST | None, strict: bool = False) -> None:
        match node:
            case ast.Constant(value=str(text)):
                texts.append((text, strict))
            case ast.JoinedStr(values=parts):
                plain = (p.value if isinstance(p, ast.Constant) else "..." for p in parts)
                texts.append(("".join(map(str, plain)), strict))
            case ast.Call(func=ast.Name(id="Strict"), args=[text]):
                look(text, True)
            case ast.Call(func=ast.Attribute(value=ast.Name(id="self"), attr=name)):
                called.append(name)
            case ast.IfExp(body=one, orelse=other):
                look(one, strict)
                look(other, strict)
            case ast.BoolOp(values=parts):
                for part in parts:
                    look(part, strict)

    for node in ast.walk(tree):
        if isinstance(node, ast.Return):
            look(node.value)
    return texts, called


def _gives_reasons(family: type, name: str) -> bool:
    """Whether a method of a family returns reasons."""
    return "str" in str(inspect.signature(getattr(family, name)).return_annotation)


def _calls_super(tree: ast.AST) -> bool:
    return any(isinstance(node, ast.Name) and node.id == "super" for node in ast.walk(tree))


def decisions(task: Task) -> str:
    """Text after the bottleneck in the docstring of a family, as Markdown."""
    text = ast.get_docstring(ast.parse(Path(inspect.getfile(task.family)).read_text())) or ""
    found = re.search(r"^Bottleneck.*?\n\n", text, re.M | re.S)
    if found is None or not text[found.end() :].strip():
        sys.exit(f"{task.name}: its docstring has no decisions after a paragraph that starts with Bottleneck")
    return text[found.end() :].strip()
