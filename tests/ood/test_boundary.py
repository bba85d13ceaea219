"""The boundary search finds a place that is known, goes on after a kill, and says where there is no way."""

import math

import pytest

from scengen import config
from scengen.errors import BadConfig
from scengen.ood import boundary
from scengen.ood.boundary import Way, search
from scengen.samplers.keyed import unit

TASK = config.task("domino_single")


@pytest.fixture
def world_where(monkeypatch):
    """Tapes live up to one place of the way and oracles up to another, each with some blur; later some come back."""

    def make(actions, oracle, blur=0.05, revival=math.inf):
        def tried(way, seed, place, index):
            def lives(who, middle):
                chance = 1 / (1 + math.exp(min(500.0, (place - middle) / blur)))
                return place > revival or unit(who, seed, index) < chance

            return {"index": index, "place": place, "replay": lives("replay", actions), "oracle": lives("oracle", oracle)}

        monkeypatch.setattr(boundary, "_try", tried)

    return make


@pytest.mark.parametrize("seed", range(4))
def test_known_boundaries_lie_in_the_intervals(world_where, tmp_path, seed):
    world_where(replay=0.4, oracle=1.7)
    found = search(TASK, "wide_gaps", tmp_path, seed=seed, rounds=20)
    for who, truth in (("replay", 0.4), ("oracle", 1.7)):
        assert found[who].low <= truth <= found[who].high and found[who].verdict == "dies on the way"
        assert found[who].high - found[who].low < 1.2


def test_the_interval_shrinks_with_more_rounds(world_where, tmp_path):
    world_where(replay=0.4, oracle=1.7)
    few, many = (search(TASK, "wide_gaps", tmp_path / str(n), rounds=n)["replay"] for n in (6, 24))
    assert many.high - many.low < 0.7 * (few.high - few.low)


def test_what_never_dies_is_alive_at_the_end_and_what_never_lives_is_dead_at_the_edge(world_where, tmp_path):
    world_where(replay=-1.0, oracle=100.0)
    found = search(TASK, "wide_gaps", tmp_path, rounds=12)
    assert found["oracle"].verdict == "alive at the end of the way" and not found["oracle"].values
    assert found["replay"].verdict == "dead at the edge of training"


def test_success_that_comes_back_farther_out_does_not_hide_the_death_before(world_where, tmp_path):
    world_where(replay=0.4, oracle=1.7, revival=3.0)
    found = search(TASK, "wide_gaps", tmp_path, rounds=20)
    assert found["replay"].verdict == "dies on the way" and found["replay"].low <= 0.4 <= found["replay"].high


def test_a_search_cut_short_goes_on_and_finds_the_same(world_where, tmp_path):
    world_where(replay=0.4, oracle=1.7)
    whole = search(TASK, "wide_gaps", tmp_path / "whole", rounds=10)
    search(TASK, "wide_gaps", tmp_path / "cut", rounds=7)
    log = tmp_path / "cut" / "boundary.jsonl"
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(lines[:-2]) + lines[-2][:9])  # killed in the middle of a round and of a line
    assert search(TASK, "wide_gaps", tmp_path / "cut", rounds=10) == whole


def test_the_way_leads_from_the_edge_of_training_through_the_axis_to_the_bounds():
    way = Way(TASK, TASK.axes["wide_gaps"])
    low, high = TASK.training["gap_ratio"].support[0], TASK.axes["wide_gaps"].replace["gap_ratio"].support[0]
    assert way.single(0.0)["gap_ratio"] == low.high and way.single(1.0)["gap_ratio"] == high.high
    assert way.single(way.end)["gap_ratio"] <= TASK.known["gap_ratio"].high
    assert way.single(way.end + boundary.STEP)["gap_ratio"] > TASK.known["gap_ratio"].high


@pytest.mark.parametrize(("name", "end"), [("domino_single", 45.0), ("domino_select", -90.0)])
def test_a_way_ends_where_it_would_come_nearer_to_training_again(name, end):
    task = config.task(name)  # trained along {0, 90} and along {0, 180} deg
    way = Way(task, task.axes["diagonal"])
    assert way.values(way.end, 0, 0)["heading"] == pytest.approx(end)


def test_an_axis_of_separate_values_has_no_way(tmp_path):
    task = config.task("tool_retrieve")
    with pytest.raises(BadConfig, match=r"moves hook\.mirrored, which takes separate values"):
        search(task, "mirrored_hook", tmp_path)
