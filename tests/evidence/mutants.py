"""Share of small changes of the tasks' code that their stored behaviour notices.

    python tests/evidence/mutants.py N PART [SEED] [TASK ...]

N one-point changes of `rules` or of `plans` are chosen at random among all families: a number times 1.02 or 1.3, a
comparison inverted, a
condition that is never true, `and` for `or`. They lie in the rules (`success`, `failure`, `events`, `build`,
`constraints` and the methods that these use), or in plans. Each is applied in a separate process, and the task is
compared with its file, cheap parts first. The result is one JSON line for each change in generated/mutants.jsonl.
"""

import ast
import importlib
import importlib.abc
import importlib.machinery
import importlib.util
import json
import os
import random
import signal
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scengen import compose, list_tasks, load_task
from scengen.evidence import comparison
from scengen.evidence.behaviour import Behaviour
from scengen.samplers.task import Task
from scengen.samplers.task_files import behaviour_file

ROOT = Path(__file__).parents[2]
RULES = ("success", "failure", "events", "pending", "build", "constraints")
"""Methods whose changes must all be noticed."""
PLANS = ("oracle", "shortcuts", "steps")
"""Methods of plans, which are counted apart."""
LIMIT = 180
"""Time after which a process is ended [s]: a changed plan may not end by itself."""
SWAPPED = {ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}


@dataclass(frozen=True)
class Mutant:
    """One change of a family's module."""

    task: str
    part: str
    """`rules` or `plans`."""
    function: str
    site: int
    """Number of the site in the function."""


class Changer(ast.NodeTransformer):
    """Counts the sites of a function, and changes one of them."""

    def __init__(self, site: int = -1):
        self.site, self.count, self.what = site, 0, ""

    def hit(self, node: ast.expr | ast.stmt, what: str) -> bool:
        self.count += 1
        if self.count - 1 == self.site:
            self.what = f"line {node.lineno}: {what}"
        return self.count - 1 == self.site

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, float) and node.value not in (0.0, 1.0):
            for factor in (1.02, 1.3):
                if self.hit(node, f"{node.value:g} times {factor}"):
                    return ast.copy_location(ast.Constant(node.value * factor), node)
        return node

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        if (kind := type(node.ops[0])) in SWAPPED and self.hit(node, f"{kind.__name__} inverted"):
            node.ops[0] = SWAPPED[kind]()
        return node

    def visit_If(self, node: ast.If) -> ast.AST:
        self.generic_visit(node)
        if self.hit(node, "condition never true"):
            node.test = ast.copy_location(ast.Constant(False), node)
        return node

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        self.generic_visit(node)
        if self.hit(node, "and for or"):
            node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        return node


def functions(module: str) -> dict[str, ast.FunctionDef]:
    """Methods of the classes of a module by name."""
    tree = ast.parse(Path(str(importlib.import_module(module).__file__)).read_text())
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    return {node.name: node for each in classes for node in each.body if isinstance(node, ast.FunctionDef)}


def used(known: dict[str, ast.FunctionDef], roots: tuple[str, ...]) -> set[str]:
    """Names of the methods that some methods use, themselves included."""
    todo, found = [name for name in roots if name in known], set[str]()
    while todo:
        if (name := todo.pop()) not in found:
            found.add(name)
            todo += [n.attr for n in ast.walk(known[name]) if isinstance(n, ast.Attribute) and n.attr in known]
    return found


def mutants(task: str) -> Iterator[Mutant]:
    """All changes of a task's family."""
    known = functions(load_task(task).family.__module__)
    rules = used(known, RULES)
    plans = used(known, PLANS) - rules
    for part, names in (("rules", rules), ("plans", plans)):
        for name in sorted(names):
            counter = Changer()
            counter.visit(known[name])
            yield from (Mutant(task, part, name, site) for site in range(counter.count))


class Loader(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Loads one module with a change in it."""

    def __init__(self, module: str, mutant: Mutant):
        self.module, self.path = module, Path(str(importlib.import_module(module).__file__))
        tree, self.changer = ast.parse(self.path.read_text()), Changer(mutant.site)
        for each in tree.body:
            for node in each.body if isinstance(each, ast.ClassDef) else ():
                if isinstance(node, ast.FunctionDef) and node.name == mutant.function:
                    self.changer.visit(node)
        self.tree = ast.fix_missing_locations(tree)

    def find_spec(self, name: str, path: Any, target: Any = None) -> importlib.machinery.ModuleSpec | None:
        return importlib.util.spec_from_loader(name, self, origin=str(self.path)) if name == self.module else None

    def create_module(self, spec: Any) -> None:
        return None

    def exec_module(self, module: Any) -> None:
        module.__file__ = str(self.path)
        exec(compile(self.tree, str(self.path), "exec"), module.__dict__)


def differences(task: Task, stored: Behaviour) -> Iterator[Sequence[comparison.Difference]]:
    """Differences of a task from its file, what is cheap to find first."""
    yield list(comparison.without_rollouts(task, stored))
    yield comparison.compare(task, stored, lambda name: name == "oracle").differences
    yield comparison.compare(task, stored, lambda name: name != "oracle").differences
    yield comparison.compare(task, stored, lambda name: False, every_split=True).differences


def judged(mutant: Mutant) -> dict[str, Any]:
    """Whether a change is noticed, and by which kinds of differences."""
    stored = Behaviour.read(behaviour_file(mutant.task))
    module = load_task(mutant.task).family.__module__
    loader = Loader(module, mutant)
    told = {**vars(mutant), "what": loader.changer.what}
    for name in [name for name in sys.modules if name.startswith("scengen.tasks.")]:
        del sys.modules[name]
    sys.meta_path.insert(0, loader)
    try:
        compose._loaded_once.cache_clear()
        task = load_task(mutant.task)
        for found in differences(task, stored):
            if found:
                levels, kinds = {each.level for each in found}, sorted({each.kind for each in found})
                return told | {"seen": True, "kinds": kinds, "level": "version" if "version" in levels else "bits"}
    except Exception as error:  # a change may break anything
        return told | {"seen": True, "kinds": [f"{type(error).__name__}: {error}"[:120]], "level": "error"}
    return told | {"seen": False, "kinds": [], "level": ""}


def apart(mutant: Mutant) -> dict[str, Any]:
    """Judge a change in a separate process."""
    reader, writer = os.pipe()
    if (child := os.fork()) == 0:
        os.close(reader)
        signal.alarm(LIMIT)
        os.write(writer, json.dumps(judged(mutant)).encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        data = pipe.read()
    os.waitpid(child, 0)
    return (
        json.loads(data) if data else {**vars(mutant), "seen": True, "kinds": ["the process ended"], "level": "error"}
    )


def main(n: str, part: str, seed: str = "0", *names: str) -> None:
    known = [task for task in names or list_tasks() if behaviour_file(task).is_file()]
    every = [mutant for task in known for mutant in mutants(task) if mutant.part == part]
    random.Random(int(seed)).shuffle(every)
    chosen = every[: int(n)]
    target = ROOT / "generated" / "mutants.jsonl"
    with target.open("a") as file:
        for mutant in chosen:
            found = apart(mutant)
            file.write(json.dumps(found) + "\n")
            file.flush()
            print(
                "seen " if found["seen"] else "BLIND",
                mutant.task,
                mutant.part,
                mutant.function,
                found.get("what"),
                found["kinds"],
            )


if __name__ == "__main__":
    main(*sys.argv[1:])
