"""A certifier that lets only easy scenarios through is seen; one that does not care is left in peace."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from pools import make, rewritten
from scipy import stats

from scengen import cli, load_task
from scengen.errors import BadConfig, PoolError
from scengen.ood.analysis.bias import acceptance_map, bias
from scengen.ood.analysis.redraw import redrawn
from scengen.params import values
from scengen.pool import Pool
from scengen.samplers.split import ID

TASK = load_task("domino_single")
DRAWS = [TASK.draw(ID, 0, i) for i in range(300)]
TABLE = {
    name: np.array([float(values(draw.scenario)[name]) for draw in DRAWS])
    for name in ("count", "gap_ratio", "heading", "tile.mass", "x", "slab.mass")
}


def test_a_certifier_that_lets_only_easy_scenarios_through_is_flagged_where_it_does():
    easy = np.random.default_rng(0).random(300) < np.where(TABLE["gap_ratio"] < 0.9, 0.95, 0.35)
    found = bias(TABLE, easy)
    assert found.flagged == ("gap_ratio", "(joint)") and found.marginals[0].name == "gap_ratio"
    assert found.marginals[0].ks > 0.15 and found.effective < 0.9 * found.accepted
    rates = [cell.rate for cell in found.marginals[0].cells]
    assert min(rates[:2]) > 0.85 and max(rates[2:]) < 0.5


def test_a_certifier_that_does_not_look_is_not_flagged():
    rng = np.random.default_rng(0)
    flags = [bias(TABLE, rng.random(300) < 0.7, 99).flagged for _ in range(20)]
    assert sum(map(bool, flags)) <= 4  # two tests at 5 % each, 20 times
    assert bias(TABLE, np.ones(300, bool)).flagged == ()


def test_a_bias_that_only_two_parameters_show_together_is_flagged_too():
    rng = np.random.default_rng(3)
    table = {"a": rng.random(600), "b": rng.random(600)}
    agree = (table["a"] > 0.5) == (table["b"] > 0.5)
    found = bias(table, agree)
    assert found.flagged == ("(joint)",)
    counted = acceptance_map(("a", "b"), table, agree)
    assert counted.proposed.sum() == 600 and counted.accepted.sum() == agree.sum()
    assert counted.accepted[0, 3] == 0 and counted.accepted[0, 0] == counted.proposed[0, 0] > 0


def test_statistics_are_those_of_scipy_between_accepted_and_proposed():
    easy = TABLE["gap_ratio"] < 0.8
    marginal = next(m for m in bias(TABLE, easy, 9).marginals if m.name == "gap_ratio")
    taken, span = TABLE["gap_ratio"][easy], np.ptp(TABLE["gap_ratio"])
    assert marginal.ks == pytest.approx(stats.ks_2samp(taken, TABLE["gap_ratio"]).statistic)
    assert marginal.energy == pytest.approx(stats.energy_distance(taken, TABLE["gap_ratio"]) / np.sqrt(span))


def test_the_effective_sample_size_is_kishs():
    """Two halves, of which all and a quarter are accepted: weights 1 and 4, (50 + 4 * 12)^2 / (50 + 16 * 12)."""
    table = {"half": np.repeat([0.0, 1.0], [50, 48])}
    accepted = np.array([True] * 50 + [True, False, False, False] * 12)
    assert bias(table, accepted, 9).effective == pytest.approx(98**2 / (50 + 16 * 12))
    assert bias(table, np.ones(98, bool)).effective == pytest.approx(98)


def test_a_part_where_nothing_is_accepted_is_lost_not_reweighted():
    table = {"half": np.repeat([0.0, 1.0], [60, 40])}
    (marginal,) = bias(table, table["half"] == 0.0, 9).marginals
    assert marginal.lost == pytest.approx(0.4) and marginal.effective == pytest.approx(60)


def test_nothing_accepted_is_an_error():
    with pytest.raises(BadConfig, match="none of the proposals was accepted"):
        bias(TABLE, np.zeros(300, bool))


# --- pools ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bias") / "pool"
    make(folder, n=2)
    return folder


def test_the_proposals_of_a_pool_are_drawn_again_from_its_manifest_alone(made):
    drawn = redrawn(Pool.open(made))
    ids = [id_ for (id_,) in Pool.open(made).columns("id")]
    assert [p.scenario.id for p in drawn if p.certified] == ids
    assert all(0 < u < 1 for p in drawn for u in p.quantiles.values()) and "gap_ratio" in drawn[0].quantiles


def test_a_pool_that_does_not_come_out_again_is_refused(made, tmp_path):
    other = shutil.copytree(made, tmp_path / "other")
    rewritten(other, lambda row: replace(row, id="0" * 12))
    with pytest.raises(PoolError, match="the family has changed since"):
        redrawn(Pool.open(other))


def test_a_manifest_that_counts_more_indices_than_it_tells_of_draws_does_not_keep_anybody_busy(made, tmp_path):
    other = shutil.copytree(made, tmp_path / "other")
    manifest = json.loads((other / "manifest.json").read_text())
    told = manifest["funnel"]["proposed"]
    (other / "manifest.json").write_text(json.dumps({**manifest, "indices": 12_000}))
    with pytest.raises(PoolError, match=f"funnel counts {told} draws"):
        redrawn(Pool.open(other))
    (other / "manifest.json").write_text(json.dumps({**manifest, "indices": 12_000_000}))
    with pytest.raises(PoolError, match="12000000 indices for 2 scenarios are too many"):
        redrawn(Pool.open(other))


def test_the_command_tells_about_a_pool_and_refuses_a_chosen_one(made, tmp_path, capsys):
    assert cli.run(("report", "audit", f"pool={made}", f"json={tmp_path / 'b.json'}")) == 0
    assert json.loads((tmp_path / "b.json").read_text())["certified"]["accepted"] == 2
    assert cli.run(("subset", f"pool={made}", "n=1", f"to={tmp_path / 'one'}")) == 0
    assert len(Pool.open(tmp_path / "one").check()) == 1
    capsys.readouterr()
    assert (
        cli.run(("report", "audit", f"pool={tmp_path / 'one'}")) == 2
        and "chosen and not drawn" in capsys.readouterr().err
    )
    assert cli.run(("subset", f"pool={made}", "n=3", f"to={tmp_path / 'two'}")) == 2
    assert cli.run(("subset", f"pool={made}", "n=1", f"to={tmp_path / 'one'}")) == 2


def test_a_scenario_that_stands_twice_is_not_chosen_twice(made, tmp_path, capsys):
    other = shutil.copytree(made, tmp_path / "other")
    first = next(Pool.open(other).rows())
    rewritten(other, lambda row: replace(first, index=row.index))
    for command in (("subset", "n=1", f"to={tmp_path / 'few'}"), ("compare",)):
        assert cli.run((*command, f"pool={other}")) == 2
        assert f"holds scenario {first.id} twice" in capsys.readouterr().err
    assert not (tmp_path / "few").exists()


def test_leaked_scenarios_make_the_comparison_fail(made, tmp_path, capsys):
    assert cli.run(("report", "compare", f"pool={made}", f"json={tmp_path / 'c.json'}")) == 0
    assert cli.run(("report", "compare", f"pool={made},{made}", "permutations=9")) == 1
    assert "near duplicates" in capsys.readouterr().out


@pytest.mark.parametrize("rejected", [1, 2, 49])
def test_a_single_draw_on_one_side_is_no_distribution(rejected):
    table = {"x": np.linspace(0.0, 1.0, 50)}
    found = bias(table, np.arange(50) >= rejected, 49)
    assert found.accepted == 50 - rejected and (rejected == 2 or not found.flagged)
