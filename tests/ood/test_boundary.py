"""The boundary search covers boundaries that are known, goes on after a kill, and says where there is no path."""

import json
import math

import numpy as np
import pytest

from scengen import load_task
from scengen.errors import BadConfig
from scengen.ood import boundary
from scengen.ood.boundary import FAILS, FAILS_AT_ONCE, HOLDS, OPEN, AxisPath, search
from scengen.samplers.keyed import unit

TASK = load_task("domino_single")
SHORT, LONG = "diagonal", "wide_gaps"
"""Axes whose paths end at 1 and beyond 4."""


def falls(middle, spread, top=1.0):
    """A chance of success that falls along a logistic curve."""
    return lambda x: top / (1 + math.exp(min(500.0, (x - middle) / spread)))


@pytest.fixture
def world_where(monkeypatch):
    """Trials end by chances along the path."""

    def make(replay, oracle):
        def tried(path, seed, fraction, index):
            solved = {who: unit(who, seed, index) < p(fraction) for who, p in (("replay", replay), ("oracle", oracle))}
            return {"index": index, "fraction": fraction, **solved}

        monkeypatch.setattr(boundary, "_try", tried)

    return make


@pytest.mark.parametrize("seed", range(4))
def test_known_boundaries_lie_in_the_intervals(world_where, tmp_path, seed):
    world_where(replay=falls(0.4, 0.02), oracle=falls(1.7, 0.05))
    found = search(TASK, LONG, tmp_path, seed=seed, rounds=20)
    for who, truth in (("replay", 0.4), ("oracle", 1.7)):
        assert found[who].low <= truth <= found[who].high and found[who].verdict == FAILS
        assert found[who].low <= found[who].middle <= found[who].high and found[who].values
    assert found["replay"].high - found["replay"].low < 0.5


def test_the_interval_shrinks_with_more_rounds(world_where, tmp_path):
    world_where(replay=falls(0.4, 0.02), oracle=falls(1.7, 0.02))
    few, many = (search(TASK, LONG, tmp_path / str(n), rounds=n)["replay"] for n in (11, 30))
    assert many.high - many.low < 0.5 * (few.high - few.low)


def test_what_never_fails_holds_to_the_end_and_what_never_succeeds_fails_at_the_edge(world_where, tmp_path):
    world_where(replay=lambda x: 0, oracle=lambda x: 1)
    found = search(TASK, SHORT, tmp_path)
    assert found["oracle"].verdict == HOLDS and found["replay"].verdict == FAILS_AT_ONCE
    assert not found["oracle"].values and not found["replay"].values
    assert str(found["oracle"]) == "> 1.00 (6 of 6 solved there, at least 0.61 at 95 %)"
    assert str(found["replay"]) == "< 0 (0 of 6 solved there, at most 0.39 at 95 %)"
    assert found["replay"].trials == 34  # the fixed looks decide


def test_too_few_trials_decide_nothing(world_where, tmp_path):
    world_where(replay=lambda x: 1, oracle=lambda x: 0)
    found = search(TASK, SHORT, tmp_path, rounds=1)
    assert {b.verdict for b in found.values()} == {OPEN} and found["replay"].high is None
    assert str(found["replay"]) == "> 0.00, perhaps > 1.00 (0 of 0 solved there, at least 0.00 at 95 %)"


@pytest.mark.parametrize("seed", range(4))
def test_a_hole_of_a_tenth_is_seen_and_so_is_the_recovery_beyond_it(world_where, tmp_path, seed):
    world_where(replay=lambda x: not 0.3 < x < 0.4, oracle=lambda x: not 0.62 < x < 0.72)
    found = search(TASK, SHORT, tmp_path, seed=seed)
    for who, hole in (("replay", 0.3), ("oracle", 0.62)):
        assert found[who].verdict == FAILS and found[who].low <= hole + 0.01 <= found[who].high
        assert hole + 0.1 <= found[who].again[0] < hole + 0.2 and found[who].again[1] == 1
        assert str(found[who]).endswith(f", holds again from {found[who].again[0]:.2f} to 1.00")


def test_twins_without_a_witness_are_left_out(monkeypatch, tmp_path):
    def tried(path, seed, fraction, index):
        solved = None if index % 3 == 0 else True
        return {"index": index, "fraction": fraction, "replay": solved, "oracle": solved}

    monkeypatch.setattr(boundary, "_try", tried)
    found = search(TASK, SHORT, tmp_path)["oracle"]
    assert found.at_end.tried == found.at_end.solved == 4 and found.trials < 64


def curves():
    """Chances of success along the path, and the first point at which each is one half or less."""
    return {
        "steep": (falls(0.503, 0.01), 0.503),
        "middling": (falls(0.503, 0.1), 0.503),
        "shallow": (falls(0.503, 0.3), 0.503),
        "reviving": (lambda x: 0.03 if 0.3 < x < 0.6 else 0.97, 0.3),
        "half reviving": (lambda x: 0.3 if 0.3 < x < 0.6 else 0.95, 0.3),
        "hole": (lambda x: 0.02 if 0.3 < x < 0.4 else 0.98, 0.3),
        "mixed twins": (lambda x: 1.0 if x < 0.1 else 0.7 if x < 0.8 else 0.0, 0.8),
        "low start": (lambda x: 0.8 if x < 0.6 else 0.0, 0.6),
        "always": (lambda x: 0.97, math.inf),
        "never": (lambda x: 0.03, 0.0),
    }


@pytest.mark.slow
@pytest.mark.parametrize("axis", [SHORT, LONG])
def test_intervals_cover_the_boundary_on_curves_of_every_kind(world_where, tmp_path, axis):
    known = curves()
    names, repetitions = list(known), 80
    for one, other in zip(names[::2], names[1::2], strict=True):
        world_where(replay=known[one][0], oracle=known[other][0])
        covered, widths = {one: 0, other: 0}, {one: [], other: []}
        for seed in range(repetitions):
            both = search(TASK, axis, tmp_path / f"{one}{seed}", seed=seed)
            for name, found in ((one, both["replay"]), (other, both["oracle"])):
                high = math.inf if found.high is None else found.high
                covered[name] += found.low <= known[name][1] <= high
                widths[name].append(min(high, found.end) - found.low)
        for name in (one, other):
            print(f"{axis} {name}: {covered[name] / repetitions:.2f} covered, width {np.mean(widths[name]):.2f}")
        assert min(covered.values()) >= 0.9 * repetitions


def test_a_search_cut_short_goes_on_and_finds_the_same(world_where, tmp_path):
    world_where(replay=falls(0.4, 0.05), oracle=falls(1.7, 0.05))
    whole = search(TASK, LONG, tmp_path / "whole", rounds=16)
    search(TASK, LONG, tmp_path / "cut", rounds=13)
    log = tmp_path / "cut" / "boundary.jsonl"
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(lines[:-2]) + lines[-2][:9])  # killed in the middle of a round and of a line
    assert search(TASK, LONG, tmp_path / "cut", rounds=16) == whole


def test_results_of_another_search_are_not_taken_for_its_own(world_where, tmp_path):
    world_where(replay=lambda x: 1, oracle=lambda x: 1)
    search(TASK, SHORT, tmp_path, rounds=1)
    log = tmp_path / "boundary.jsonl"
    identity, *records = log.read_text().splitlines(keepends=True)
    earlier = {name: value for name, value in json.loads(identity).items() if name != "fixed"}
    log.write_text(json.dumps(earlier) + "\n" + "".join(records))
    with pytest.raises(BadConfig, match=r"other pools or settings \(fixed\); give fresh=true .* choose another to="):
        search(TASK, SHORT, tmp_path, rounds=1)


def test_the_path_leads_from_the_edge_of_training_through_the_axis_to_the_bounds():
    path = AxisPath(TASK, TASK.axes[LONG])
    low, high = TASK.training["gap_ratio"].support[0], TASK.axes[LONG].replace["gap_ratio"].support[0]
    assert path.single(0.0)["gap_ratio"] == low.high and path.single(1.0)["gap_ratio"] == high.high
    assert path.single(path.end)["gap_ratio"] <= TASK.known["gap_ratio"].high
    assert path.single(path.end + boundary.PATH_STEP)["gap_ratio"] > TASK.known["gap_ratio"].high


@pytest.mark.parametrize(("name", "end"), [("domino_single", 45.0), ("domino_select", -90.0)])
def test_a_path_ends_where_it_would_come_nearer_to_training_again(name, end):
    task = load_task(name)  # trained along {0, 90} and along {0, 180} deg
    path = AxisPath(task, task.axes["diagonal"])
    assert path.values(path.end, 0, 0)["heading"] == pytest.approx(end)


def test_an_axis_of_separate_values_has_no_path(tmp_path):
    task = load_task("tool_retrieve")
    with pytest.raises(BadConfig, match=r"moves hook\.mirrored, which has separate values"):
        search(task, "mirrored_hook", tmp_path)
