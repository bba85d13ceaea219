"""Every design is keyed and order-free, keeps twins, and does what its name says."""

import itertools
import math
from collections import Counter

import numpy as np
import pytest
from scipy.stats import qmc

from scengen import cli, load_task
from scengen.errors import BadConfig, Infeasible
from scengen.ood.analysis.coverage import evenness
from scengen.params import values
from scengen.runs.generate import GenerateSettings
from scengen.samplers.designs import Grid, Latin, Sobol
from scengen.samplers.keyed import unit
from scengen.samplers.split import ID
from scengen.samplers.task import load

NODE = load_task("domino_single").node
TASK = load_task("domino_single")
SPELLED = ["iid", "sobol", "lhs:16", "grid:3"]
VARIED = [name for name, dist in TASK.training.items() if dist.support[0].low != dist.support[-1].high]


def numbers(spelled, count, seed=0):
    design = TASK.design(spelled)
    return np.array([[design.number(n, seed, i, 0) for n in VARIED] for i in range(count)])


def test_independent_draws_are_the_keyed_numbers_that_they_always_were():
    assert TASK.design("iid").number("x", 3, 14, 1) == unit("domino_single", "x", 3, 14, 1)
    assert values(TASK.draw(ID, 0, 5).scenario) == values(TASK.draw(ID, 0, 5, TASK.design("iid")).scenario)


@pytest.mark.parametrize("spelled", SPELLED)
def test_an_index_can_be_made_alone_in_any_order_and_lies_inside_the_unit_interval(spelled):
    forwards = numbers(spelled, 50)
    backwards = {i: [TASK.design(spelled).number(n, 0, i, 0) for n in reversed(VARIED)] for i in reversed(range(50))}
    assert all(backwards[i][::-1] == list(forwards[i]) for i in range(50))
    assert ((forwards > 0) & (forwards < 1)).all()
    assert not np.array_equal(forwards, numbers(spelled, 50, seed=1))


@pytest.mark.parametrize("spelled", SPELLED)
def test_twins_share_every_parameter_that_the_axis_does_not_name_in_every_design(spelled):
    design = TASK.design(spelled)
    for index in range(10):
        trained, shifted = (values(TASK.draw(split, 0, index, design).scenario) for split in (ID, "wide_gaps"))
        assert {n for n in trained if trained[n] != shifted[n]} == {"gap_ratio"}


@pytest.mark.parametrize("spelled", ["iid", "sobol", "lhs:16"])
def test_to_let_one_more_parameter_vary_moves_no_other_in_any_design_but_a_grid(spelled):
    richer = load("domino_single", {**NODE, "id": {**NODE["id"], "slab": {"mass": ["uniform", 0.05, 0.07]}}})
    for index in range(10):
        before = values(TASK.draw(ID, 0, index, TASK.design(spelled)).scenario)
        after = values(richer.draw(ID, 0, index, richer.design(spelled)).scenario)
        assert {n for n in before if before[n] != after[n]} == {"slab.mass"}


@pytest.mark.parametrize("spelled", ["sobol", "lhs:16"])
def test_later_tries_are_keyed_and_independent_of_the_design(spelled):
    design = TASK.design(spelled)
    assert design.number("x", 0, 7, 1) == unit("domino_single", "x", 0, 7, 1) != design.number("x", 0, 7, 0)


@pytest.mark.parametrize("spelled", ["sobol", "lhs:64"])
def test_designs_are_more_even_than_independent_draws(spelled):
    spread = evenness(numbers(spelled, 64)).discrepancy
    independent = [evenness(numbers("iid", 64, seed)).discrepancy for seed in range(20)]
    assert spread < min(independent)


def test_sobol_numbers_are_the_plain_sequence_but_for_the_shift():
    design = Sobol("t", ("a", "b", "c"))
    plain = (qmc.Sobol(3, scramble=False).random(64) * 2**30).astype(np.int64)
    first = np.array([[int(design.number(n, 0, i, 0) * 2**30) for n in design.names] for i in range(64)])
    assert len(np.unique(plain ^ first, axis=0)) == 1
    late = (qmc.Sobol(3, scramble=False).random(2048)[1020:1030] * 2**30).astype(np.int64)  # across two blocks
    ours = np.array([[int(design.number(n, 0, i, 0) * 2**30) for n in design.names] for i in range(1020, 1030)])
    assert np.array_equal(late ^ ours, np.repeat((plain ^ first)[:1], 10, axis=0))


def test_each_hypercube_meets_every_stratum_of_every_parameter_once():
    design = Latin("t", 10)
    for name, block in itertools.product("ab", range(3)):
        found = [int(10 * design.number(name, 0, 10 * block + i, 0)) for i in range(10)]
        assert sorted(found) == list(range(10))
    order = [[int(10 * design.number(n, 0, i, 0)) for i in range(10)] for n in "ab"]
    assert order[0] != order[1]


def test_a_grid_meets_every_combination_once_and_ends():
    design = Grid("t", {"a": 3, "b": 4, "c": 2}, 3)
    met = Counter(tuple(round(design.number(n, 5, i, 0) * k - 0.5) for n, k in design.sizes.items()) for i in range(24))
    assert set(met) == set(itertools.product(range(3), range(4), range(2))) and set(met.values()) == {1}
    with pytest.raises(BadConfig, match="has 24 points"):
        design.number("a", 5, 24, 0)
    assert {design.number("only an axis", 5, i, 0) for i in range(6)} == {1 / 6, 0.5, 5 / 6}


def test_a_grid_lists_whole_numbers_and_choices_in_full():
    design = TASK.design("grid:2")
    assert design.size == 4 * 2 * math.prod([2] * 6)
    drawn = [values(TASK.draw(ID, 0, i, design).scenario) for i in range(60)]
    assert {d["count"] for d in drawn} == {3, 4, 5, 6} and {round(d["gap_ratio"], 9) for d in drawn} == {0.75, 1.05}


def test_an_infeasible_grid_point_is_infeasible_and_not_replaced():
    wide = load("domino_single", {**NODE, "id": {**NODE["id"], "gap_ratio": ["uniform", 1.5, 2.5]}})
    design, outcomes = wide.design("grid:2"), []
    for index in range(40):
        try:
            outcomes.append(wide.draw(ID, 0, index, design).attempt)
        except Infeasible as error:
            assert error.tries == 1
            outcomes.append(None)
    assert None in outcomes and 0 in outcomes and set(outcomes) == {None, 0}


@pytest.mark.parametrize("spelled", ["sobl", "lhs", "lhs:0", "lhs:x", "grid:-1", "iid:3", "sobol:5", ""])
def test_a_sampler_that_does_not_exist_is_refused(spelled):
    with pytest.raises(BadConfig, match="known: iid, sobol, lhs:STRATA"):
        GenerateSettings(sampler=spelled).check(TASK)


def test_the_command_line_refuses_it_in_one_line(capsys):
    assert cli.run(("generate", "task=domino_single", "sampler=sobl")) == 2
    assert "did you mean 'sobol'" in capsys.readouterr().err
