"""The packages in integrations/ with the real harnesses: `python tools/check_integrations.py [NAME ...]`.

Each gets a separate environment below build/integrations, from the package index, and its `check.py` plays the
policy `replay` on a pool in distribution and on one out of it. The verdicts of all scenarios must be those of `scengen
evaluate`; that of robomimic compares the actions of a checkpoint. A package whose Python is missing is told as not
tried. Exit status 1 if one fails.
"""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

from stacks import found_python

from scengen.installation import ROBOSUITE

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "build" / "integrations"
SPLITS = {"id": 10, "diagonal": 10}
"""Number of scenarios of domino_single by split."""


def packages() -> dict[str, str]:
    """The packages, and the version of Python that each needs."""
    found = {}
    for path in sorted((ROOT / "integrations").glob("*/pyproject.toml")):
        needs = tomllib.loads(path.read_text())["project"]["requires-python"].removeprefix(">=")
        found[path.parent.name] = "" if sys.version_info >= tuple(map(int, needs.split("."))) else needs
    return found


def pools(home: Path) -> list[str]:
    """Folders of the pools, certified in the environment, whose MuJoCo may be another one. Missing ones are made."""
    folders = [home / "pools" / split for split in SPLITS]
    for folder, (split, n) in zip(folders, SPLITS.items(), strict=True):
        if not (folder / "manifest.json").exists():
            run(
                home / "bin" / "scengen", "generate", "task=domino_single", f"split={split}", f"n={n}", f"pool={folder}"
            )
    return [str(folder) for folder in folders]


def checked(name: str, interpreter: str) -> bool:
    """Whether the check of a package passes in a separate environment."""
    home, here = FOLDER / name, ROOT / "integrations" / name
    python = home / "bin" / "python"
    if not python.exists():
        shutil.rmtree(home, ignore_errors=True)
        run(interpreter, "-m", "venv", home)
    install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    run(*install, ROOT, here)
    run(*install, "--no-deps", f"robosuite=={ROBOSUITE}")  # the robot's files
    print(f"{name}:", flush=True)
    return subprocess.run([python, here / "check.py", *pools(home)], cwd=FOLDER).returncode == 0


def run(*command: str | Path) -> None:
    """Run a command that must succeed."""
    if subprocess.run(command).returncode:
        sys.exit(f"failed: {' '.join(map(str, command))}")


def main(*names: str) -> None:
    """Check packages."""
    known, failed = packages(), []
    if strange := set(names) - set(known):
        sys.exit(f"integrations/{strange.pop()} is no package; there are {', '.join(known)}")
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names or known:
        interpreter = found_python(known[name])
        if not interpreter:
            print(f"{name}: not tried: no python{known[name]} on this machine", flush=True)
        elif not checked(name, interpreter):
            failed.append(name)
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main(*sys.argv[1:])
