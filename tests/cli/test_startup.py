"""What asks for little loads little: help, the version and a mistyped command import none of the heavy packages, the
list of tasks none of the families; and what takes seconds says so."""

import json
import os
import subprocess
import sys

import pytest

from scengen import list_tasks, load_task
from scengen.control.compilation import NOTICE
from scengen.samplers import task_files

HEAVY = {"mujoco", "numba", "scipy", "numpy", "hydra", "pyarrow", "matplotlib", "robosuite", "gymnasium"}
MOST = 250
"""Modules, the some 60 of the bare interpreter included."""
COUNT = "import json, sys; from scengen import cli; print(json.dumps([cli.run({}), list(sys.modules)]))"


@pytest.mark.parametrize(
    ("given", "status"),
    [([], 0), (["--help"], 0), (["--version"], 0), (["generat"], 2), (["generate", "--help"], 0)],
)
def test_what_asks_for_little_loads_little(given, status):
    done = subprocess.run([sys.executable, "-c", COUNT.format(given)], capture_output=True, text=True, check=True)
    told, modules = json.loads(done.stdout.splitlines()[-1])
    assert told == status and not HEAVY & set(modules) and len(modules) < MOST


@pytest.mark.parametrize("name", list_tasks())
def test_a_task_is_told_of_as_it_is_loaded(name):
    """The list of tasks is made from their files alone: what it says is what the loaded family and axes say."""
    about, task = task_files.about(name), load_task(name)
    for key in ("name", "code", "category", "instruction", "embodiment"):
        assert getattr(about, key) == getattr(task, key)
    assert about.axes == tuple(task.axes) and task_files.version(name) == task.version
    assert about.paper_axes == tuple(axis.name for axis in task.axes.values() if task.of_paper(axis))


@pytest.mark.parametrize(("given", "families"), [(["tasks"], 0), (["tasks", "task=domino_single"], 1)])
def test_the_list_of_tasks_imports_no_family(given, families):
    done = subprocess.run([sys.executable, "-c", COUNT.format(given)], capture_output=True, text=True, check=True)
    told, modules = json.loads(done.stdout.splitlines()[-1])
    assert told == 0 and sum(name.startswith("scengen.tasks.") for name in modules) == families


@pytest.mark.parametrize("load", ["scengen.load_task('domino_single')", "import scengen.envs.gym"])
def test_a_task_and_its_environments_need_neither_ray_nor_the_settings_of_commands(load):
    code = f"import json, sys, scengen; {load}; print(json.dumps(list(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules = json.loads(done.stdout.splitlines()[-1])
    assert "scengen.compose" in modules
    assert not {"ray", "scengen.work.cluster"} & set(modules)
    assert not [name for name in modules if name.startswith("scengen.cli.commands")]


@pytest.mark.slow
def test_the_first_compilation_is_told_of_once(tmp_path):
    """Twice with a cache of compiled code that is empty at first: what is compiled is told, what is read is not."""
    simulate = "from scengen import cli; cli.run(['--complete', 'x']); cli.run(['--complete', 'x']); "
    simulate += "from scengen.work.fingerprint import fingerprint; print(fingerprint())"
    first, second = (
        subprocess.run(
            [sys.executable, "-c", simulate],
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
            capture_output=True,
            text=True,
            check=True,
        )
        for _ in range(2)
    )
    assert first.stderr.splitlines() == [NOTICE] and second.stderr == ""
    assert first.stdout == second.stdout
