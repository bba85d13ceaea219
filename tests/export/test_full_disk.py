"""Where a file cannot grow, a command ends with one line, and nothing that looks finished is left."""

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import REFERENCE, needs_robosuite

from scengen.pool import Pool

ROOT = Path(__file__).parents[2]
COMMANDS = {
    "record robomimic": ("record to={to}.hdf5 format=robomimic n=1", 100),
    "record lerobot": ("record to={to} cameras=none n=1", 20),
    "record lerobot with cameras": ("record to={to} n=1 width=160 height=120 cameras=[rgb_exo_right_cam]", 20),
    "export": ("export to={to}", 30),
    "export without robot": ("export to={to} robot=false", 2),
    "export batch": ("export to={to} format=batch layout=1", 5),
    "export hub": ("export hub to={to}", 20),
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
@pytest.mark.slow
def test_a_file_that_cannot_grow_is_one_line_and_leaves_nothing(tmp_path, name):
    if name == "record robomimic":
        needs_robosuite()
    command, kilobytes = COMMANDS[name]
    status, told = limited(command, kilobytes, tmp_path / "new")
    lines = [line for line in told.splitlines() if not line.startswith(("verify ", "export ", "record "))]
    assert status == 2 and len(lines) == 1 and "raise the limit of the size of files (ulimit -f)" in lines[0], told
    left = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert not [path for path in left if path.name.startswith("new") or path.suffix == ".xml"], left


@pytest.mark.slow
def test_what_was_exported_before_is_kept(tmp_path):
    before = tmp_path / "new" / "0123456789ab" / "scene.xml"
    before.parent.mkdir(parents=True)
    before.write_text("<mujoco/>")
    assert limited(*COMMANDS["export"], tmp_path / "new")[0] == 2
    assert list(tmp_path.rglob("*.xml")) == [before] and before.read_text() == "<mujoco/>"


@pytest.mark.slow
def test_a_film_before_is_kept(tmp_path):
    film = tmp_path / "new.mp4"
    film.write_bytes(b"film before")
    scenario = next(iter(Pool.open(REFERENCE).rows())).id
    status, told = limited(f"show film to={film} id={scenario} fps=10 width=160 height=120", 2, tmp_path / "new")
    assert status == 2 and told.splitlines()[-1].endswith(
        "file too large; raise the limit of the size of files (ulimit -f) and repeat the command"
    ), told
    assert list(tmp_path.iterdir()) == [film] and film.read_bytes() == b"film before"


STORE = """
import sys
from pathlib import Path
import numpy as np
from scengen.attack.evidence import Hit
from scengen.errors import BadConfig
actions = np.random.default_rng(int(sys.argv[2])).random((400, 8))
hit = Hit("0123456789ab", "random", True, "a plan", 1.0, "0" * 16, (), (), {"a": 1.0}, actions)
try:
    hit.store(Path(sys.argv[1]))
except BadConfig as error:
    sys.exit(f"refused: {error}")
"""


def stored(folder, seed, kilobytes):
    line = shlex.join([sys.executable, "-c", STORE, str(folder), str(seed)])
    shell = f"trap '' XFSZ; ulimit -f {kilobytes}; exec {line}"
    return subprocess.run(["bash", "-c", shell], capture_output=True, text=True, cwd=ROOT).stderr


@pytest.mark.slow
def test_a_hit_before_is_kept(tmp_path):
    assert stored(tmp_path, 0, "unlimited") == ""
    (hit,) = tmp_path.iterdir()
    before = hit.read_bytes()
    told = stored(tmp_path, 1, 1)
    assert told.startswith("refused: ") and "file too large" in told.lower(), told
    assert list(tmp_path.iterdir()) == [hit] and hit.read_bytes() == before
