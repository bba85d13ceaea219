"""Runs the commands of README.md and docs/ in order, in a temporary folder: `python tests/readme/run.py [all]`.

Without `all`, those of `commands.APART` are omitted. Exit status 1 means that a command failed.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parents[1])]

from readme.commands import commands, why_apart  # noqa: E402

POLICY = """
class Still:
    def reset(self, observation, info, seed):
        pass

    def act(self, observation):
        return [0.0] * 7


def make_policy(env):
    return Still()
"""
"""The policy `my_package:make_policy` of the pages."""
MESH = "scengen asset name=cup to=mug.obj"
"""Writes the mesh `mug.obj` of the pages."""


def run(command: str, folder: Path) -> tuple[int, str, float]:
    """Exit status of a command, what it said, and its processor time [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env={**os.environ, "PATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done.returncode, done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    everything = sys.argv[1:] == ["all"]
    failed = []
    with tempfile.TemporaryDirectory(prefix="readme") as made:
        Path(made, "my_package.py").write_text(POLICY)
        for command in (MESH, *commands()):
            told = " ".join(command.split("#")[0].split())
            if (why := why_apart(command)) and not everything:
                print(f"omitted    {told}: {why}", flush=True)
                continue
            status, said, seconds = run(command, Path(made))
            print(f"exit {status} {seconds:4.0f} s  {told}", flush=True)
            if status:
                failed.append(told)
                print(said, flush=True)
    print(f"{len(failed)} commands failed", flush=True)
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
