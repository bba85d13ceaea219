"""The boundary search finds a point that is known, goes on after a kill, and says where there is no path."""

import math

import pytest

from scengen import config
from scengen.errors import BadConfig
from scengen.ood import boundary
from scengen.ood.boundary import FAILS, FAILS_AT_ONCE, HOLDS, AxisPath, search
from scengen.samplers.keyed import unit

TASK = config.task("domino_single")


@pytest.fixture
def world_where(monkeypatch):
    """Replays succeed up to one point of the path and oracles up to another, with some blur; later all may recover."""

    def make(replay, oracle, blur=0.05, recovery=math.inf):
        def tried(path, seed, fraction, index):
            def solves(who, middle):
                chance = 1 / (1 + math.exp(min(500.0, (fraction - middle) / blur)))
                return fraction > recovery or unit(who, seed, index) < chance

            solved = {"replay": solves("replay", replay), "oracle": solves("oracle", oracle)}
            return {"index": index, "fraction": fraction, **solved}

        monkeypatch.setattr(boundary, "_try", tried)

    return make


@pytest.mark.parametrize("seed", range(4))
def test_known_boundaries_lie_in_the_intervals(world_where, tmp_path, seed):
    world_where(replay=0.4, oracle=1.7)
    found = search(TASK, "wide_gaps", tmp_path, seed=seed, rounds=20)
    for who, truth in (("replay", 0.4), ("oracle", 1.7)):
        assert found[who].low <= truth <= found[who].high and found[who].verdict == FAILS
        assert found[who].high - found[who].low < 1.2


def test_the_interval_shrinks_with_more_rounds(world_where, tmp_path):
    world_where(replay=0.4, oracle=1.7)
    few, many = (search(TASK, "wide_gaps", tmp_path / str(n), rounds=n)["replay"] for n in (6, 24))
    assert many.high - many.low < 0.7 * (few.high - few.low)


def test_what_never_fails_holds_to_the_end_and_what_never_succeeds_fails_at_the_edge(world_where, tmp_path):
    world_where(replay=-1.0, oracle=100.0)
    found = search(TASK, "wide_gaps", tmp_path, rounds=12)
    assert found["oracle"].verdict == HOLDS and not found["oracle"].values
    assert found["replay"].verdict == FAILS_AT_ONCE


def test_success_that_comes_back_farther_out_does_not_hide_the_failure_before(world_where, tmp_path):
    world_where(replay=0.4, oracle=1.7, recovery=3.0)
    found = search(TASK, "wide_gaps", tmp_path, rounds=20)
    assert found["replay"].verdict == FAILS and found["replay"].low <= 0.4 <= found["replay"].high


def test_a_search_cut_short_goes_on_and_finds_the_same(world_where, tmp_path):
    world_where(replay=0.4, oracle=1.7)
    whole = search(TASK, "wide_gaps", tmp_path / "whole", rounds=10)
    search(TASK, "wide_gaps", tmp_path / "cut", rounds=7)
    log = tmp_path / "cut" / "boundary.jsonl"
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(lines[:-2]) + lines[-2][:9])  # killed in the middle of a round and of a line
    assert search(TASK, "wide_gaps", tmp_path / "cut", rounds=10) == whole


def test_the_path_leads_from_the_edge_of_training_through_the_axis_to_the_bounds():
    path = AxisPath(TASK, TASK.axes["wide_gaps"])
    low, high = TASK.training["gap_ratio"].support[0], TASK.axes["wide_gaps"].replace["gap_ratio"].support[0]
    assert path.single(0.0)["gap_ratio"] == low.high and path.single(1.0)["gap_ratio"] == high.high
    assert path.single(path.end)["gap_ratio"] <= TASK.known["gap_ratio"].high
    assert path.single(path.end + boundary.STEP)["gap_ratio"] > TASK.known["gap_ratio"].high


@pytest.mark.parametrize(("name", "end"), [("domino_single", 45.0), ("domino_select", -90.0)])
def test_a_path_ends_where_it_would_come_nearer_to_training_again(name, end):
    task = config.task(name)  # trained along {0, 90} and along {0, 180} deg
    path = AxisPath(task, task.axes["diagonal"])
    assert path.values(path.end, 0, 0)["heading"] == pytest.approx(end)


def test_an_axis_of_separate_values_has_no_path(tmp_path):
    task = config.task("tool_retrieve")
    with pytest.raises(BadConfig, match=r"moves hook\.mirrored, which takes separate values"):
        search(task, "mirrored_hook", tmp_path)
