import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from scengen import list_tasks, load_task
from scengen.errors import BadConfig, Infeasible
from scengen.params import values
from scengen.samplers.dists import Choice, Fixed, Integer, LogUniform, Uniform, parse
from scengen.samplers.keyed import normals, unit
from scengen.samplers.split import ID
from scengen.samplers.task import load

GOLDEN = Path(__file__).parents[1] / "golden" / "draws.json"
FIRST = 12
"""Draws of a split that its checksum covers: a changed range or formula moves nearly all of them."""
TASKS = list_tasks()
NODE = load_task("domino_single").node


def test_a_number_depends_on_its_key_alone():
    assert unit("task", "x", 0, 3, 0) == unit("task", "x", 0, 3, 0)
    assert len({unit("task", name, seed, i, 0) for name in "xy" for seed in (0, 1) for i in range(50)}) == 200


def test_the_keyed_numbers_are_uniform_and_normal():
    assert stats.kstest([unit("u", i) for i in range(4000)], "uniform").pvalue > 1e-3
    drawn = np.array([normals(6, "n", i) for i in range(2000)])
    assert stats.kstest(drawn.ravel(), "norm").pvalue > 1e-3
    assert np.abs(np.corrcoef(drawn.T) - np.eye(6)).max() < 0.1, "numbers of one key are independent"


def test_neighbouring_keys_are_uncorrelated():
    x, y = ([unit("task", name, 0, i, 0) for i in range(2000)] for name in ("x", "y"))
    assert abs(np.corrcoef(x, y)[0, 1]) < 0.08


@given(st.floats(0, 1, exclude_max=True))
def test_no_draw_leaves_its_support(u):
    for dist in (Fixed(3), Uniform(0.6, 1.2), LogUniform(0.1, 10.0), Integer(3, 6), Choice((0.0, 90.0))):
        assert any(i.low <= dist.quantile(u) <= i.high for i in dist.support)


@pytest.mark.parametrize("dist", [Integer(3, 6), Choice((3, 4, 5, 6))])
def test_whole_numbers_and_choices_are_equally_likely(dist):
    counts = np.bincount([dist.quantile(unit("d", i)) for i in range(4000)], minlength=7)[3:]
    assert stats.chisquare(counts).pvalue > 1e-3


def test_log_uniform_spreads_factors_evenly():
    logs = np.log([LogUniform(0.01, 1.0).quantile(unit("l", i)) for i in range(4000)])
    assert stats.kstest(logs, stats.uniform(np.log(0.01), np.log(100)).cdf).pvalue > 1e-3


@pytest.mark.parametrize(
    ("node", "says"),
    [
        (["unifrm", 1, 2], "did you mean 'uniform'"),
        (["uniform", 1], "low, high"),
        (["uniform", 2, 1], "the low end lies above the high end"),
        (["uniform", 1, "b"], "takes finite numbers"),
        (["uniform", 0, float("nan")], "takes finite numbers"),
        (["loguniform", 0, 1], "must be positive"),
        (["integer", 1.5, 2], "whole numbers"),
        (["choice"], "takes finite numbers"),
        ({"uniform": [1, 2]}, "must be a number or one of"),
        ("0.5", "must be a number or one of"),
        (True, "must be a number or one of"),
        ([], "must be a number or one of"),
    ],
)
def test_a_distribution_that_makes_no_sense_is_refused(node, says):
    with pytest.raises(BadConfig, match=says):
        parse("task.id.x", node)


def test_a_bare_number_is_a_constant():
    assert parse("x", 0.5) == Fixed(0.5)


def test_an_axis_changes_only_what_it_names():
    """Here for one task; tests/tasks/test_conformance.py asks it of every axis of all."""
    task = load_task("domino_single")
    for axis, moved in task.axes.items():
        for index in range(12):
            trained, shifted = task.draw(ID, 0, index), task.draw(axis, 0, index)
            before, after = values(trained.scenario), values(shifted.scenario)
            assert {n for n in before if before[n] != after[n]} == set(moved.replace)
            assert shifted.id_twin == trained.scenario.id


def test_composed_axes_move_what_each_moves_alone():
    task = load_task("domino_single")
    for index in range(20):
        both = values(task.draw("diagonal+wide_gaps", 0, index).scenario)
        assert both["heading"] == values(task.draw("diagonal", 0, index).scenario)["heading"]
        assert both["gap_ratio"] == values(task.draw("wide_gaps", 0, index).scenario)["gap_ratio"]


def test_a_new_parameter_or_axis_moves_no_other_value():
    richer = load("domino_single", {**NODE, "id": {**NODE["id"], "slab": {"mass": ["uniform", 0.05, 0.07]}}})
    for index in range(20):
        before = values(load_task("domino_single").draw(ID, 0, index).scenario)
        after = values(richer.draw(ID, 0, index).scenario)
        assert {n for n in before if before[n] != after[n]} == {"slab.mass"}


def test_rejected_draws_are_counted_by_reason():
    task = load("domino_single", {**NODE, "id": {**NODE["id"], "gap_ratio": ["uniform", 1.5, 2.5], "x": 0.0, "y": 0.0}})
    draws = [task.draw(ID, 0, i) for i in range(30)]
    assert any(d.rejected.get("a falling tile cannot reach its neighbour") for d in draws)
    assert all(sum(d.rejected.values()) == d.attempt for d in draws)


def test_a_distribution_without_a_feasible_draw_says_why():
    task = load("domino_single", {**NODE, "id": {**NODE["id"], "gap_ratio": 2.4}})
    with pytest.raises(Infeasible, match="none of 100 draws was feasible .*cannot reach its neighbour"):
        task.draw(ID, 0, 0)


def golden_draws() -> dict[str, str]:
    """A checksum of the first draws of every split."""
    sums = {}
    for name in TASKS:
        task = load_task(name)
        for split in (ID, *task.axes):
            text = json.dumps([_drawn(task, split, i) for i in range(FIRST)], sort_keys=True)
            sums[f"{name}/{split}"] = hashlib.sha256(text.encode()).hexdigest()[:16]
    return sums


def _drawn(task, split, index):
    try:
        return values(task.draw(split, 0, index).scenario)
    except Infeasible as error:
        return dict(error.reasons)


def test_the_first_draws_of_every_split_are_what_they_were():
    """If this fails on purpose: say so in the CHANGELOG under "Draws", and run this file with Python."""
    assert golden_draws() == json.loads(GOLDEN.read_text())


if __name__ == "__main__":
    GOLDEN.parent.mkdir(exist_ok=True)
    GOLDEN.write_text(json.dumps(golden_draws(), indent=1) + "\n")
