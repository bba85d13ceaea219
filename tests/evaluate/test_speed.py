"""Measurements of cost: sides work in turn, and the report says when the machine was busy."""

import time

import pytest
from helpers import REFERENCE

from scengen.bench import speed, vector_speed
from scengen.bench.quiet import disturbance
from scengen.bench.timing import Measure, alternated
from scengen.envs.vector import PoolVectorEnv
from scengen.pool import Pool


def busy(seconds, slices, order, name):
    """A side that works for as long in slices."""

    def side():
        for _ in range(slices):
            order.append(name)
            end = time.thread_time() + seconds / slices
            while time.thread_time() < end:
                pass
            yield

    return side


def test_sides_work_by_turns_and_only_their_own_time_counts():
    order = []

    def sleeping():
        for _ in range(2):
            time.sleep(0.05)
            yield

    found = alternated([busy(0.02, 4, order, "a"), busy(0.01, 2, order, "b"), sleeping], 2)
    assert order[:6] == ["a", "b", "a", "b", "a", "a"] and len(found) == 2
    for one, other, asleep in found:
        assert one == pytest.approx(0.02, rel=0.2) and other == pytest.approx(0.01, rel=0.2) and asleep < 0.01


def test_the_sliced_rollout_is_the_rollout_of_a_certificate(monkeypatch):
    """Both sides end in the state of the recorded rollout: they do the work that they are said to do."""
    ends = []

    def played(sides, repeats):
        worlds = [side.__closure__ for side in sides]
        for side in sides:
            for _ in side():
                pass
        for cells in worlds:
            (world,) = (c.cell_contents for c in cells if type(c.cell_contents).__name__ == "World")
            ends.append(world.data.qpos.copy())
        return [(1.0, 1.0)]

    monkeypatch.setattr(speed, "alternated", played)
    speed.rollout_to_raw(1)
    assert (ends[0] == ends[1]).all()


def test_the_slots_and_the_bare_simulations_end_in_the_same_state(monkeypatch):
    """Both sides do the work that they are said to do: the slots go through the states of the bare simulations."""
    monkeypatch.setattr(vector_speed, "SLOTS", 2)
    row = next(Pool.open(REFERENCE).rows())
    envs = PoolVectorEnv(row.task, REFERENCE, 2, scenario=row.id)
    actions = row.witness[:40]
    bare = vector_speed._bare(row, actions)
    for side in (vector_speed._stepping(envs, actions), bare):
        assert sum(1 for _ in side()) == 40
    cells = {name: cell.cell_contents for name, cell in zip(bare.__code__.co_freevars, bare.__closure__, strict=True)}
    assert all((world.data.qpos == envs.envs[0].world.data.qpos).all() for world in cells["worlds"])
    assert (envs.envs[0].world.data.qpos == envs.envs[1].world.data.qpos).all()


def test_a_machine_that_was_not_quiet_is_told():
    steady, wide = Measure((1.2, 1.21, 1.22)), Measure((1.2, 1.3, 1.5))
    assert disturbance(0.1, 0.01, {"x": steady}) == ""
    assert "load average was 2.0" in disturbance(2.0, 0.0, {"x": steady})
    assert "waited for a core in 20% of the time" in disturbance(0.1, 0.2, {"x": steady})
    assert "y spread by more than 10%" in disturbance(0.1, 0.0, {"x": steady, "y": wide})
    assert (wide.median, round(wide.spread, 9)) == (1.3, 0.3)
