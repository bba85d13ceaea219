"""A stored scene that MuJoCo does not read is one line wherever it is used."""

import shutil
from dataclasses import replace

import pytest
from helpers import REFERENCE, env_class, needs_robosuite

from scengen import cli, load_task
from scengen.attack.campaign import certified, player_of
from scengen.envs.gym import PoolEnv
from scengen.errors import PoolError
from scengen.export.mjcf import export
from scengen.pool import Pool
from scengen.pool.writing import write_pool
from scengen.validate.playable import check_row, stored_world

SAYS = "MuJoCo does not read the scene.*number is too large.*; see scengen verify$"


@pytest.fixture(scope="module")
def pool(tmp_path_factory):
    """The reference pool with a number that MuJoCo does not read."""
    folder = shutil.copytree(REFERENCE, tmp_path_factory.mktemp("unreadable") / "pool")
    of = Pool.open(folder)
    rows = [replace(row, scene_xml=row.scene_xml.replace('pos="0 ', 'pos="1e400 ', 1)) for row in of.rows()]
    write_pool(folder, of.manifest.without_files(), rows)
    return folder


USES = {
    "gym": lambda row, pool, folder: PoolEnv(row.task, pool).reset(),
    "robosuite": lambda row, pool, folder: env_class(row.task)(
        scenario=row, use_camera_obs=False, has_offscreen_renderer=False
    ),
    "attack": lambda row, pool, folder: player_of(*certified(load_task(row.task), [row])),
    "export": lambda row, pool, folder: export(row, folder, robot=False),
    "replay": lambda row, pool, folder: stored_world(row),
    "show": lambda row, pool, folder: check_row(row),
}


@pytest.mark.parametrize("use", USES)
def test_a_scene_that_mujoco_does_not_read_is_one_line(pool, tmp_path, use):
    with pytest.raises(PoolError, match=SAYS):
        USES[use](Pool.open(pool).at(0), pool, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["export to={to}", "record to={to}", "verify robosuite"])
def test_commands_end_with_status_2(pool, tmp_path, capsys, command):
    if command == "verify robosuite":
        needs_robosuite()
    assert cli.run([*command.format(to=tmp_path / "to").split(), f"pool={pool}"]) == 2
    assert "MuJoCo does not read the scene" in capsys.readouterr().err.splitlines()[-1]
