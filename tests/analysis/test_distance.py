"""Distances against closed forms, leakage, and coverage."""

import math

import numpy as np
import pytest
from scipy import stats

from scengen import load_task
from scengen.ood.analysis.coverage import evenness, farthest_points
from scengen.ood.analysis.distance import energy, near_duplicates, offsets, per_parameter
from scengen.ood.analysis.space import Batch, of_features, of_parameters
from scengen.params import with_values
from scengen.samplers.split import ID
from scengen.symmetry import Symmetry

TASK = load_task("domino_single")
TRAINED = {f"id {i}": TASK.draw(ID, 0, i).scenario for i in range(40)}


def repeated(scenarios, others=None):
    """Near duplicates within one batch, or between two."""
    return near_duplicates(TASK, Batch.of(scenarios), Batch.of(others) if others else None)


def of_normals(shift: float) -> float:
    """Energy distance of N(0, 1) and N(shift, 1): E|N(d, 2)| is the mean of a folded normal."""
    folded = 2 / math.sqrt(math.pi) * math.exp(-(shift**2) / 4) + shift * math.erf(shift / 2)
    return math.sqrt(2 * folded - 2 * 2 / math.sqrt(math.pi))


@pytest.mark.parametrize("shift", [0.5, 1.0, 2.0])
def test_the_energy_distance_of_two_normals_is_the_closed_form(shift):
    quantiles = stats.norm.ppf((np.arange(400) + 0.5) / 400)[:, None]
    assert energy(quantiles, quantiles + shift, permutations=9).distance == pytest.approx(of_normals(shift), rel=0.01)


def test_in_one_dimension_it_is_that_of_scipy():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=30), rng.gamma(2.0, size=50)
    assert energy(x[:, None], y[:, None], 9).distance == pytest.approx(stats.energy_distance(x, y))


def test_a_shift_is_found_and_none_is_not():
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=(40, 3)), rng.normal(size=(40, 3))
    assert energy(x, y + np.array([1.5, 0.0, 0.0])).pvalue < 0.01 < 0.1 < energy(x, y).pvalue


def test_without_a_shift_the_p_values_are_uniform():
    rng = np.random.default_rng(2)
    pvalues = [energy(rng.normal(size=(8, 2)), rng.normal(size=(8, 2)), 99).pvalue for _ in range(60)]
    assert stats.kstest(pvalues, "uniform").pvalue > 1e-3


def test_a_single_vector_tells_nothing_from_chance():
    found = energy(np.zeros((1, 2)), np.ones((3, 2)))
    assert found.pvalue == 1.0 and found.distance == found.chance == pytest.approx(math.sqrt(2 * math.sqrt(2)))


def test_an_offset_is_the_way_to_the_nearest_training_value():
    (offset,) = offsets(TASK, with_values(TRAINED["id 0"], {"gap_ratio": 1.5}))
    assert (
        offset.parameter == "gap_ratio" and offset.gap == pytest.approx(0.3) and offset.relative == pytest.approx(0.5)
    )
    (turned,) = offsets(TASK, with_values(TRAINED["id 0"], {"slab_yaw": -90.0}))
    assert abs(turned.gap) == pytest.approx(82.0)
    assert not offsets(TASK, TRAINED["id 0"])


def test_a_split_is_as_far_from_training_as_its_axis_says():
    away = per_parameter(TASK, Batch.of({f"{i}": TASK.draw("wide_gaps", 0, i).scenario for i in range(40)}))
    ((name, (least, mean)),) = away.items()
    assert name == "gap_ratio" and 0.05 / 0.6 <= least < mean == pytest.approx(0.125 / 0.6, rel=0.2)


def test_a_turn_by_the_period_is_no_distance():
    here, there = (with_values(TRAINED["id 0"], {"slab_yaw": yaw}) for yaw in (-90.0, 90.0))
    assert np.ptp(of_parameters(TASK, [here, there]).points([here, there]), axis=0) == pytest.approx(0.0)


def test_the_energy_distance_is_over_the_declared_features():
    ids, wide = list(TRAINED.values()), [TASK.draw("wide_gaps", 0, i).scenario for i in range(40)]
    space = of_features(TASK, ids, wide)
    assert space.names[0] == "gap_over_height"
    assert energy(space.points(ids), space.points(wide), 99).pvalue <= 0.01
    turned = [TASK.draw("diagonal", 0, i).scenario for i in range(40)]
    assert energy(space.points(ids), space.points(turned), 99).distance == pytest.approx(0.0, abs=1e-6)


def test_leakage_is_found_and_neighbours_are_not():
    close = with_values(TRAINED["id 3"], {"x": TRAINED["id 3"].x + 0.0004})
    far = with_values(TRAINED["id 4"], {"x": TRAINED["id 4"].x + 0.004})
    (pair,) = repeated(TRAINED, {"close": close, "far": far})
    assert (pair.one, pair.other) == ("id 3", "close") and pair.distance == pytest.approx(0.004)
    assert not repeated(TRAINED)
    assert len(repeated({**TRAINED, "again": TRAINED["id 5"]})) == 1
    assert not repeated(TRAINED, {f"{i}": TASK.draw(ID, 1, i).scenario for i in range(40)})


def test_leakage_in_disguise_is_found(monkeypatch):
    """The chain seen in a mirror; nobody claims that this is a symmetry of the robot."""
    mirror = Symmetry("mirror", reflect={"y": 0.0, "heading": 0.0, "slab_yaw": 0.0})
    s = TRAINED["id 3"]
    image = with_values(s, {"y": -s.y, "heading": -s.heading, "slab_yaw": -s.slab_yaw + 0.0})
    assert not repeated(TRAINED, {"image": image})
    monkeypatch.setattr(TASK.family, "SYMMETRIES", (mirror,))
    (pair,) = repeated(TRAINED, {"image": image})
    assert pair.one == "id 3" and pair.distance == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("d", [1, 3, 8])
def test_the_expected_discrepancy_of_independent_draws_is_the_closed_form(d):
    rng = np.random.default_rng(d)
    found = [evenness(rng.random((20, d))).relative for _ in range(400)]
    assert np.mean(found) == pytest.approx(1.0, abs=4 * np.std(found) / 20)


def test_half_a_distribution_is_uneven():
    rng = np.random.default_rng(0)
    assert evenness(rng.random((100, 2)) * [0.5, 1.0]).relative > 10


def test_the_farthest_points_of_a_grid_with_a_crowd_leave_the_crowd_alone():
    grid = np.array([[x, y] for x in range(5) for y in range(5)], float)
    crowd = np.random.default_rng(0).normal(2.0, 0.05, (200, 2))
    chosen = farthest_points(np.concatenate([crowd, grid]), 26)
    assert len(set(chosen)) == 26
    first = np.concatenate([crowd, grid])[chosen[:5]]
    apart = np.linalg.norm(first[:, None] - first[None], axis=2)[np.triu_indices(5, 1)]
    assert apart.min() > 2.7  # the middle and the four corners
    assert list(chosen[:9]) == list(farthest_points(np.concatenate([crowd, grid]), 9))


def twins(random, shift, common=0.95):
    """Fifty pairs that have most in common."""
    training = random.standard_normal((50, 1))
    return training, common * training + np.sqrt(1 - common**2) * random.standard_normal((50, 1)) + shift


def test_what_twins_have_in_common_hides_no_shift():
    random = np.random.default_rng(0)
    unpaired, paired = 0, 0
    for _ in range(20):
        x, y = twins(random, 0.3)
        unpaired += energy(x, y, 199).pvalue < 0.05
        paired += energy(x, y, 199, twins=True).pvalue < 0.05
    assert paired >= 18 and unpaired <= 8


def test_without_a_shift_twins_are_seldom_told_apart():
    random = np.random.default_rng(1)
    pvalues = [energy(*twins(random, 0.0), 199, twins=True).pvalue for _ in range(60)]
    assert np.mean(np.array(pvalues) < 0.05) < 0.15


def test_identical_twins_are_equal_and_others_are_told_what_chance_gives():
    x, y = twins(np.random.default_rng(2), 0.0)
    assert str(energy(x, x, twins=True)) == "equal"
    found = energy(x, y, 199, twins=True)
    assert 0.0 < found.chance < 0.5 and str(found).startswith(f"{found.distance:.2g} (by chance ")
