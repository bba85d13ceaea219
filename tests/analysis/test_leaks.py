"""Observations that tell a hidden parameter are found, and those that do not are not accused."""

import json

import numpy as np
import pytest

from scengen import cli, load_task
from scengen.envs import object_state
from scengen.ood.analysis.leaks import MIN_EXPLAINED, explained, leaks

N = 200


@pytest.fixture
def random():
    return np.random.default_rng(5)


def test_a_stream_that_has_the_parameter_tells_it(random):
    hidden, noise = random.normal(size=N), random.normal(size=(N, 30))
    assert explained(list(np.column_stack([noise, 1e-6 * hidden + 0.3])), hidden) > 0.99
    assert explained(list(np.column_stack([noise, hidden**2])), hidden**2) > 0.99


def test_a_part_of_the_variance_is_measured(random):
    hidden = random.normal(size=N)
    assert explained(list((hidden + random.normal(size=N))[:, None]), hidden) == pytest.approx(0.5, abs=0.15)


def test_noise_tells_nothing(random):
    """Two hundred streams of forty columns, each with a parameter of its own."""
    told = [explained(list(random.normal(size=(N, 40))), random.normal(size=N)) for _ in range(200)]
    assert max(told) < MIN_EXPLAINED


def test_a_constant_stream_tells_nothing():
    assert explained([np.zeros(3)] * N, np.arange(N, dtype=float)) == 0.0


@pytest.mark.parametrize(("task", "parameter"), [("seesaw_balance", "target.mass")])
@pytest.mark.slow
def test_what_very_fine_poses_tell_is_not_in_object_state(monkeypatch, task, parameter):
    """A block leans the beam on its stop by hundredths of a degree more, the heavier it is."""
    found = leaks(load_task(task), "id", 60, 3)
    assert found.draws == 60 and parameter in found.hidden and not found.found
    monkeypatch.setattr(object_state, "RESOLUTION", dict.fromkeys(object_state.RESOLUTION, 1e-12))
    told = {leak.parameter: leak for leak in leaks(load_task(task), "id", 60, 3).found}
    assert told[parameter].explained > 0.5


@pytest.mark.slow
def test_the_command_prints_leaks(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(object_state, "RESOLUTION", dict.fromkeys(object_state.RESOLUTION, 1e-12))
    monkeypatch.setattr("scengen.cli.commands.attack.LEAK_DRAWS", 60)
    target = tmp_path / "report.json"
    assert cli.run(["attack", "task=seesaw_balance", "n=1", "tiers=[leaks]", f"json={target}"]) == 0
    assert "target.mass" in [leak["parameter"] for leak in json.loads(target.read_text())["leaks"]["found"]]
    told = capsys.readouterr()
    assert "hidden parameters in 60 draws of id: observations reveal" in told.out
    assert "LEAK" in told.err and "reveals target.mass: explained variance" in told.err
