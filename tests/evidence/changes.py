"""Proof that refactoring is free, and that changes of tasks are noticed.

    python tests/evidence/changes.py [refactorings|changes] [NAME ...]

Each edit of the lists in `refactorings_*.py` and `changes_*.py` is applied to a temporary copy of the tree, in which
its tasks are compared with their stored behaviour: all core rollouts, or all rollouts if the edit says so. A
refactoring must not make a task another one. A change must be noticed, with the kind of difference that the edit names.
One line per edit says what still reproduces (bits, verdicts, no) and which kinds differ; generated/changes.jsonl
collects the results. The exit status is 1 if an edit is judged otherwise than it must be.

An edit says which text it replaces. If the code has moved, the command names the edit that has to be mended.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from typing import Any

import changes_below
import changes_rules
import changes_tasks
import refactorings_ground
import refactorings_moves
import refactorings_tasks_a_to_k
import refactorings_tasks_l_to_z
from edit import ROBOT, ROOT, Edit, StaleEdit, apply, copied

from scengen.robots import files

REFACTORINGS = (refactorings_ground, refactorings_moves, refactorings_tasks_a_to_k, refactorings_tasks_l_to_z)
CHANGES = (changes_below, changes_rules, changes_tasks)
LISTS: dict[str, tuple[Edit, ...]] = {
    "refactorings": tuple(edit for part in REFACTORINGS for edit in part.EDITS),
    "changes": tuple(edit for part in CHANGES for edit in part.EDITS),
}
"""All edits by kind."""
ORDER = ("bits", "verdicts", "no")
"""What a task reproduces, from everything to nothing."""
TIME_LIMIT = 600
"""Time after which a comparison is ended [s]: a changed plan may not end by itself."""
JUDGE = """
import json, pathlib, sys
from scengen import load_task
from scengen.evidence.behaviour import Behaviour, is_core
from scengen.evidence.comparison import compare
longer = sys.argv[1] == "longer"
for name in sys.argv[2:]:
    stored = pathlib.Path("conf", "behaviour", f"{name}.json")
    wanted = (lambda name: True) if longer else is_core
    found = compare(load_task(name), Behaviour.read(stored), wanted, every_split=longer)
    told = [[each.kind, each.level, str(each)] for each in found.differences]
    print(json.dumps([name, found.reproduces, told]), flush=True)
"""
"""Program that compares tasks in the copy, and prints for each its name, what it reproduces, and its differences."""


def compared(edit: Edit) -> dict[str, Any]:
    """What the comparison says of each task after an edit: by name, or an `error`.

    Raises:
        StaleEdit: the edit does not fit the present code.
    """
    with copied() as tree:
        apply(edit, tree)
        command = [sys.executable, "-c", JUDGE, "longer" if edit.longer else "core", *edit.tasks]
        variables = {**os.environ, "PYTHONPATH": str(tree), files.VARIABLE: str(tree / ROBOT)}
        try:
            done = subprocess.run(command, cwd=tree, env=variables, capture_output=True, text=True, timeout=TIME_LIMIT)
        except subprocess.TimeoutExpired:
            return {"error": f"took longer than {TIME_LIMIT} s"}
    if done.returncode:
        return {"error": (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]}
    rows = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
    return {name: {"reproduces": reproduces, "differences": told} for name, reproduces, told in rows}


def is_right(edit: Edit, result: dict[str, Any]) -> bool:
    """Whether the comparison judges an edit as it must."""
    if "error" in result:
        return False
    return all(_judged(edit, told["reproduces"], told["differences"]) for told in result.values())


def _judged(edit: Edit, reproduces: str, differences: Sequence[Sequence[str]]) -> bool:
    """Whether one task is judged as it must be."""
    if not edit.kinds:
        return ORDER.index(reproduces) <= edit.rounds
    levels = ("version",) if edit.least == "version" else ("version", "bits")
    return any(kind in edit.kinds and level in levels for kind, level, _ in differences)


def line(edit: Edit, result: dict[str, Any], right: bool) -> str:
    """One line about an edit."""
    if "error" in result:
        told = result["error"]
    else:
        kinds = {name: sorted({kind for kind, _, _ in each["differences"]}) for name, each in result.items()}
        told = "; ".join(f"{name}: {each['reproduces']} {kinds[name] or ''}".strip() for name, each in result.items())
    verdict = "ERROR" if "error" in result else "right" if right else "misjudged" if edit.misjudged else "WRONG"
    return f"{verdict:9} {edit.name}: {told}"


def run(kind: str, edits: Sequence[Edit]) -> Iterator[tuple[Edit, bool | None]]:
    """Apply edits one after the other, print a line about each, and yield whether it was judged rightly: None after an
    error."""
    target = ROOT / "generated" / "changes.jsonl"
    with target.open("a") as file:
        for edit in edits:
            begun = time.perf_counter()
            try:
                result = compared(edit)
            except StaleEdit as error:
                result = {"error": str(error)}
            right, seconds = is_right(edit, result), round(time.perf_counter() - begun, 1)
            row = {"kind": kind, "edit": edit.name, "right": right, "seconds": seconds, "found": result}
            file.write(json.dumps(row) + "\n")
            file.flush()
            print(line(edit, result, right), flush=True)
            yield edit, None if "error" in result else right


def main(arguments: Sequence[str]) -> int:
    kinds, names = [each for each in arguments if each in LISTS] or list(LISTS), set(arguments) - set(LISTS)
    known = {edit.name for kind in kinds for edit in LISTS[kind]}
    if unknown := names - known:
        print(f"no edits named {', '.join(sorted(unknown))}; known: {', '.join(sorted(known))}")
        return 2
    wrong = 0
    for kind in kinds:
        found = list(run(kind, [edit for edit in LISTS[kind] if not names or edit.name in names]))
        amiss = [edit.name for edit, right in found if right is None or right == bool(edit.misjudged)]
        wrong += len(amiss)
        marked = sum(bool(edit.misjudged) and right is False for edit, right in found)
        told = f"{sum(bool(right) for _, right in found)} of {len(found)} {kind} are judged rightly"
        print(f"{told}, {marked} wrongly as their marks say{', otherwise: ' if amiss else ''}{', '.join(amiss)}")
    return min(wrong, 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
