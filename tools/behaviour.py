"""Write, check and compare the stored behaviour of tasks (conf/behaviour).

    python tools/behaviour.py write [TASK ...]
    python tools/behaviour.py check [changed] [TASK ...]
    python tools/behaviour.py against COMMIT [n=10] [TASK ...]

`write` stores the behaviour of a new task, or of a task whose VERSION has risen. If the version is the stored one,
only bits may differ; if verdicts, draws, scenes or rules differ, nothing is written, and VERSION has to rise. `check`
plays all stored rollouts of all splits, kept cheats included; with `changed` only of tasks whose code has a different
hash than at the last check, which it then updates. `against` plays N fresh training draws, whose seed is the commit,
here and in a work tree of that commit, and compares verdicts and bits.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from arguments import parted

from scengen import list_tasks, load_task
from scengen.errors import ScengenError
from scengen.evidence.behaviour import Behaviour, Cheat, made, observe
from scengen.evidence.comparison import Compared, compare, merged
from scengen.samplers.task import Task
from scengen.samplers.task_files import behaviour_file

ROOT = Path(__file__).parent.parent


def cheats(task: str) -> dict[str, Cheat]:
    """Kept cheats of a task by name."""
    folder = ROOT / "tests" / "attack"
    sys.path.insert(0, str(folder))
    known = import_module(f"hands.{task}").HANDS if (folder / "hands" / f"{task}.py").is_file() else {}
    return {name: (hand.plan, hand.raw) for name, hand in known.items()}


def compared(task: Task) -> Compared:
    """Compare everything that is stored."""
    return compare(
        task, Behaviour.read(behaviour_file(task.name)), lambda name: True, cheats(task.name), every_split=True
    )


def write(*names: str) -> int:
    """Store behaviour; returns the number of tasks that were refused."""
    refused = 0
    for task in map(load_task, names or list_tasks()):
        path = behaviour_file(task.name)
        stored = Behaviour.read(path) if path.is_file() else None
        if stored is None or stored.version < task.version:
            observe(task, cheats(task.name)).write(path)
            print(f"{task.name}: version {task.version} is stored", flush=True)
            continue
        found = compared(task)
        if found.reproduces == "no":
            refused += 1
            print("\n".join(map(str, found.differences)))
            print(f"{task.name}: refused: raise VERSION, and add a line under Draws in CHANGELOG.md", flush=True)
        elif found.differences or stored.made != made(task):
            merged(stored, observe(task, cheats(task.name), steady=False)).write(path)
            print(f"{task.name}: bits are stored; {len(found.differences)} differed", flush=True)
        else:
            print(f"{task.name}: nothing differs", flush=True)
    return refused


def check(*arguments: str) -> int:
    """Play all that is stored; returns the number of tasks that differ."""
    changed, names, wrong = "changed" in arguments, [name for name in arguments if name != "changed"], 0
    for task in map(load_task, names or list_tasks()):
        path = behaviour_file(task.name)
        stored = Behaviour.read(path)
        text = made(task)["text"]
        if changed and stored.made["text"] == text:
            continue
        found = compared(task)
        wrong += bool(found.differences)
        print("\n".join([*map(str, found.differences), f"{task.name}: {found.rollouts} rollouts: {found.reproduces}"]))
        if not found.differences and stored.made["text"] != text:
            replace(stored, made={**stored.made, "text": text}).write(path)
    return wrong


def against(commit: str, *arguments: str) -> int:
    """Compare fresh draws with those of another commit; returns the number of tasks that differ."""
    names, options = parted(arguments, "n")
    count, wrong = int(options.get("n") or 10), 0
    seed = int(_git("rev-parse", commit)[:7], 16)
    with work_tree(commit) as tree:
        for name in names or list_tasks():
            here, there = (afresh(folder, name, seed, count) for folder in (ROOT, tree))
            differ = [key for key in here.keys() | there.keys() if here.get(key) != there.get(key)]
            verdicts = [key for key in differ if _verdict(here.get(key)) != _verdict(there.get(key))]
            wrong += bool(verdicts)
            share = 100 * (1 - 0.05 ** (1 / count))
            told = f"{name}: {len(here)} results of {count} draws, {len(differ)} with other bits, {len(verdicts)} other"
            print(f"{told}; an effect on {share:.0f} % of draws or more is excluded at 95 %", flush=True)
            for key in sorted(verdicts):
                print(f"  {key}: {there.get(key)} is now {here.get(key)}")
    return wrong


def _verdict(result: Any) -> Any:
    return result[0] if isinstance(result, list) and result else result


def afresh(tree: Path, task: str, seed: int, count: int) -> dict[str, Any]:
    """Results of fresh draws as the code of a work tree plays them."""
    lines = "import json, sys; from scengen import load_task; from scengen.evidence.behaviour import played_afresh"
    code = f"{lines}; print(json.dumps(played_afresh(load_task({task!r}), {seed}, {count})))"
    done = subprocess.run([sys.executable, "-c", code], cwd=tree, env={"PYTHONPATH": str(tree)}, capture_output=True)
    if done.returncode:
        raise ScengenError(f"{tree.name} cannot play {task}: {done.stderr.decode().strip().splitlines()[-1][:200]}")
    return json.loads(done.stdout.splitlines()[-1])


@contextmanager
def work_tree(commit: str) -> Iterator[Path]:
    """A work tree of a commit, which is removed afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        _git("worktree", "add", "--quiet", "--detach", str(tree), commit)
        try:
            yield tree
        finally:
            _git("worktree", "remove", "--force", str(tree))


def _git(*arguments: str) -> str:
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


VERBS = {"write": write, "check": check, "against": against}


def main(arguments: Sequence[str]) -> int:
    verb, *others = arguments or ("",)
    if verb not in VERBS:
        print(__doc__)
        return 2
    return min(VERBS[verb](*others), 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
