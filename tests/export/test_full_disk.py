"""Where a file cannot grow, a command ends with one line, and nothing that looks finished is left."""

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import REFERENCE

ROOT = Path(__file__).parents[2]
COMMANDS = {
    "record robomimic": ("record to={to}.hdf5 format=robomimic n=1", 100),
    "record lerobot": ("record to={to} cameras=none n=1", 20),
    "export": ("export to={to}", 30),
    "export without robot": ("export to={to} robot=false", 2),
    "publish": ("publish to={to}", 20),
    "report": ("report to={to}.html", 20),
    "subset": ("subset to={to} n=2", 10),
    "verify": ("verify json={to}.json level=replay", 1),
}
"""Commands, and a size of files [KiB] that is too small for each."""


def limited(command, kilobytes, to):
    line = [sys.executable, "-m", "scengen", *command.format(to=to).split(), f"pool={REFERENCE}"]
    shell = f"ulimit -f {kilobytes}; exec {shlex.join(line)}"
    done = subprocess.run(["bash", "-c", shell], capture_output=True, text=True, cwd=ROOT)
    return done.returncode, done.stderr


@pytest.mark.parametrize("name", COMMANDS)
def test_a_file_that_cannot_grow_is_one_line_and_leaves_nothing(tmp_path, name):
    command, kilobytes = COMMANDS[name]
    status, told = limited(command, kilobytes, tmp_path / "new")
    lines = [line for line in told.splitlines() if not line.startswith(("verify ", "export ", "record "))]
    assert status == 2 and len(lines) == 1 and "raise the limit of the size of files (ulimit -f)" in lines[0], told
    left = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert not [path for path in left if path.name.startswith("new") or path.suffix == ".xml"], left


def test_what_was_exported_before_is_kept(tmp_path):
    before = tmp_path / "new" / "0123456789ab" / "scene.xml"
    before.parent.mkdir(parents=True)
    before.write_text("<mujoco/>")
    assert limited(*COMMANDS["export"], tmp_path / "new")[0] == 2
    assert list(tmp_path.rglob("*.xml")) == [before] and before.read_text() == "<mujoco/>"
