"""The tests and certificates under several versions of Python, MuJoCo and numpy, and the packages in integrations/.

    python tools/stacks.py sample                    # one small sample on MuJoCo 4, for CI
    python tools/stacks.py all [STACK ...]           # quick tests, and one scenario of each task, for docs/stacks.md
    python tools/stacks.py integrations [NAME ...]   # packages in integrations/ with the real harnesses

Each stack has an environment below build/stacks, into which pip resolves scengen without overrides. robosuite, from
which the robot's files are read, is installed without its requirements. A stack whose Python is missing is reported as
not tried. Results are stored in records/stacks.

A package of integrations/ gets an environment below build/integrations, and its `check.py` plays the policy `replay` on
a pool in distribution and on one out of it. The verdicts of all scenarios must be those of `scengen evaluate`; that of
robomimic compares the actions of a checkpoint.
"""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from scengen.installation import ROBOSUITE

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "build" / "stacks"
RECORDS = ROOT / "records" / "stacks"
SAMPLE_TASKS = ("domino_single", "cup_extract")
"""Tasks of the sample: the smallest one, and the one whose scene depends on a flag that MuJoCo 4 has inverted."""
SPLITS = {"id": 10, "diagonal": 10}
"""Number of scenarios of domino_single by split, on which packages are checked."""
SAMPLE_TESTS = ("tests/control", "tests/sim", "tests/robots", "tests/skills")


@dataclass(frozen=True)
class Stack:
    """An environment."""

    name: str
    python: str
    """Version of Python; empty for that of this process."""
    requirements: tuple[str, ...]
    """Requirements beside scengen."""


STACKS = (
    Stack("mujoco4", "", ("mujoco==4.0.0", "numpy>=2")),
    Stack("mujoco4-python3.12-lerobot", "3.12", ("mujoco==4.0.0", "numpy>=2", "lerobot[training]>=0.6,<0.7")),
    Stack("mujoco4-python3.13", "3.13", ("mujoco==4.0.0", "numpy>=2")),
    Stack("mujoco4-python3.14", "3.14", ("mujoco==4.0.0", "numpy>=2")),
)
"""Stacks beside that of `make setup`, which `make ci` tests."""


def main(what: str = "", *names: str) -> None:
    """Try stacks or packages, and end with status 1 if one fails."""
    known = packages() if what == "integrations" else {stack.name: stack for stack in STACKS}
    if what not in ("sample", "all", "integrations") or set(names) - set(known):
        sys.exit(
            f"say stacks.py sample, stacks.py all [STACK ...] or stacks.py integrations [NAME ...]; known: {[*known]}"
        )
    failed = []
    for stack in STACKS[:1] if what == "sample" else [known[name] for name in names or known]:
        interpreter = found_python(stack.python)
        if not interpreter:
            print(f"{stack.name}: not tried: no python{stack.python} on this machine", flush=True)
        elif not TRIALS[what](interpreter, stack):
            failed.append(stack.name)
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)


def found_python(version: str) -> str:
    """Path of an interpreter: on the path, or one of pyenv's; empty if there is none."""
    if not version:
        return sys.executable
    own = sorted((Path.home() / ".pyenv" / "versions").glob(f"{version}.*/bin/python"))
    found = [shutil.which(f"python{version}"), *map(str, own[-1:])]
    works = (path for path in found if path and not subprocess.run([path, "--version"], capture_output=True).returncode)
    return next(works, "")  # pyenv has a command for each version, which fails unless the version is selected


def environment_of(folder: Path, interpreter: str, requirements: Sequence[str], alone: Sequence[str] = ()) -> Path:
    """The interpreter of an environment, which is made if it is missing or made from other requirements.

    Args:
        folder: folder of the environment.
        interpreter: Python from which it is made.
        requirements: arguments of pip.
        alone: requirements that are installed without theirs.
    """
    python, ready = folder / "bin" / "python", folder / "ready"
    own = (ROOT / "pyproject.toml").read_text() if any(str(ROOT) in one for one in requirements) else ""
    wanted = "\n".join([interpreter, *requirements, *alone, own])
    if not ready.is_file() or ready.read_text() != wanted:
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run([interpreter, "-m", "venv", folder], check=True)
        install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*install, *requirements], check=True)
        if alone:
            subprocess.run([*install, "--no-deps", *alone], check=True)
        ready.write_text(wanted)
    return python


def of_stack(interpreter: str, stack: Stack) -> Path:
    """The interpreter of a stack's environment, with the files of the robot."""
    requirements = ("-e", f"{ROOT}[dev]", *stack.requirements)
    return environment_of(FOLDER / stack.name, interpreter, requirements, (f"robosuite=={ROBOSUITE}",))


def runner(python: Path, stack: Stack) -> Callable[..., bool]:
    """A function that runs a module of Python in an environment, and returns whether it succeeded."""
    places = {
        "NUMBA_CACHE_DIR": str(FOLDER / f"{stack.name}-numba"),
        "SCENGEN_REFERENCE": str(FOLDER / f"{stack.name}-pool"),
    }
    environment = {**os.environ, **places}

    def run(*words: str) -> bool:
        print(f"{stack.name}: {' '.join(words)}", flush=True)
        return subprocess.run([python, "-m", *words], cwd=ROOT, env=environment).returncode == 0

    return run


def fresh(stack: Stack, name: str) -> str:
    """Folder for a pool of a stack, which is not there yet."""
    folder = FOLDER / f"{stack.name}-{name}"
    for path in (folder, folder.with_name(f"{folder.name}.run")):
        shutil.rmtree(path, ignore_errors=True)
    return str(folder)


def sampled(interpreter: str, stack: Stack) -> bool:
    """Tests of control, simulation and moves; pools of two tasks, verified and compared under 3.5; one of 3.5."""
    python = of_stack(interpreter, stack)
    run, good = runner(python, stack), True
    for task in SAMPLE_TASKS:
        pool = fresh(stack, task)
        good &= run("scengen", "generate", f"task={task}", "n=1", f"pool={pool}") and run(
            "scengen", "verify", f"pool={pool}"
        )
    good &= run(
        "scengen", "verify", "mujoco", f"pool={FOLDER / f'{stack.name}-{SAMPLE_TASKS[0]}'}", "mujoco=[3.5.0,4.0.0]"
    )
    good &= run("scengen", "verify", "pool=generated/reference/domino_single-id", "mujoco=any")
    return good & run("pytest", "-q", "-p", "no:cacheprovider", *SAMPLE_TESTS)


def tried(interpreter: str, stack: Stack) -> bool:
    """The quick tests, and one scenario of each task, certified and verified. The result is stored."""
    python = of_stack(interpreter, stack)
    run = runner(python, stack)
    made = run("scengen", "generate", "task=domino_single", "n=6", "workers=2", f"pool={fresh(stack, 'pool')}")
    tests = made and run("pytest", "-q", "-p", "no:cacheprovider", "-n", "2", "--dist", "loadfile")
    verdicts = dict(certified(run, stack))
    about = json.loads(subprocess.run([python, "-c", ABOUT], capture_output=True, text=True, check=True).stdout)
    RECORDS.mkdir(parents=True, exist_ok=True)
    record = {**about, "quick tests": tests, "tasks": verdicts}
    (RECORDS / f"{stack.name}.json").write_text(json.dumps(record, indent=1, sort_keys=True) + "\n")
    return tests and all(verdicts.values())


ABOUT = """
import json, platform
from importlib.metadata import PackageNotFoundError, version
found = {"python": platform.python_version()}
for name in ("mujoco", "numpy", "numba", "pyarrow", "robosuite", "lerobot", "torch"):
    try:
        found[name] = version(name)
    except PackageNotFoundError:
        pass
print(json.dumps(found))
"""
"""Program that prints the versions of an environment."""


def certified(run: Callable[..., bool], stack: Stack) -> Iterator[tuple[str, bool]]:
    """Every task, and whether its first scenario was certified and verified."""
    for task in sorted(path.stem for path in (ROOT / "conf" / "task").glob("*.yaml")):
        pool = fresh(stack, task)
        yield (
            task,
            run("scengen", "generate", f"task={task}", "n=1", f"pool={pool}")
            and run("scengen", "verify", f"pool={pool}"),
        )


def packages() -> dict[str, Stack]:
    """The packages in integrations/, with the version of Python that each needs."""
    found = {}
    for path in sorted((ROOT / "integrations").glob("*/pyproject.toml")):
        needs = tomllib.loads(path.read_text())["project"]["requires-python"].removeprefix(">=")
        python = "" if sys.version_info >= tuple(map(int, needs.split("."))) else needs
        found[path.parent.name] = Stack(path.parent.name, python, (str(ROOT), str(path.parent)))
    return found


def integrated(interpreter: str, package: Stack) -> bool:
    """Whether the check of a package passes, on pools that are certified in its environment."""
    home = ROOT / "build" / "integrations" / package.name
    python = environment_of(home, interpreter, package.requirements, (f"robosuite=={ROBOSUITE}",))
    install = [
        python,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "--no-deps",
        "--force-reinstall",
    ]
    subprocess.run([*install, *package.requirements], check=True)  # the code of today
    folders = [home / "pools" / split for split in SPLITS]
    for folder, (split, n) in zip(folders, SPLITS.items(), strict=True):
        if not (folder / "manifest.json").exists():
            asked = ("task=domino_single", f"split={split}", f"n={n}", f"pool={folder}")
            subprocess.run([home / "bin" / "scengen", "generate", *asked], check=True)
    print(f"{package.name}:", flush=True)
    check = ROOT / "integrations" / package.name / "check.py"
    return subprocess.run([python, check, *folders], cwd=home.parent).returncode == 0


TRIALS: Mapping[str, Callable[[str, Stack], bool]] = {"sample": sampled, "all": tried, "integrations": integrated}
"""Functions that try a stack or a package with an interpreter, and return whether it passes."""


if __name__ == "__main__":
    main(*sys.argv[1:])
