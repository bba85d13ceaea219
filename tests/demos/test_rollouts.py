"""Rollouts of policies are kept as demonstrations, failures included: they replay bit for bit and can be recorded."""

import json
import shutil
from itertools import pairwise

import numpy as np
import pyarrow.parquet as pq
import pytest
from helpers import REFERENCE

from scengen import cli
from scengen.cli.commands import identified
from scengen.means import throughout
from scengen.pool import Pool
from scengen.pool.demonstrations import DEMONSTRATIONS, Demonstrations
from scengen.tasks.domino_single import DominoSingle


def evaluate(folder, *words):
    return cli.run(
        ["evaluate", f"pool={REFERENCE}", f"to={folder}", "seeds=2", "rollouts=1", "keep=[episodes]", *words]
    )


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Two rollouts of the oracle, which succeed, and two of random actions, which do not."""
    folder = tmp_path_factory.mktemp("kept")
    assert evaluate(folder / "oracle", "policy=oracle") == 0
    assert evaluate(folder / "random", "policy=random") == 0
    return folder


def rollouts(folder, policy):
    return Demonstrations.open(folder / policy / "rollouts" / REFERENCE.name)


def test_show_says_what_kept_rollouts_are(kept, capsys):
    folder = rollouts(kept, "random").folder
    assert cli.run(["show", f"pool={folder}"]) == 0
    out = capsys.readouterr()
    shown = " ".join((out.out + out.err).split())
    assert "kept rollouts of policy random on domino_single/id, strict rules: 0 successes" in shown
    assert all(str(name) in out.out for name in {row.name for row in rollouts(kept, "random").attempts()})
    name = next(rollouts(kept, "random").attempts()).name
    assert identified(str(folder), None, name.index) == name.id, "failed rollouts have an index, too"
    assert cli.run(["show", f"pool={folder}", "to=sheet.html"]) == 2
    assert "scengen show film" in capsys.readouterr().err
    assert cli.run(["evaluate", "policy=idle", f"pool={folder}"]) == 2
    assert "it is demonstrations (demonstrations.json); name a pool" in " ".join(capsys.readouterr().err.split())


def test_kept_rollouts_say_their_policy_and_are_those_of_the_evaluation(kept):
    for policy, successes in (("oracle", 2), ("random", 0)):
        found, scenarios = rollouts(kept, policy), {id_ for (id_,) in Pool.open(REFERENCE).columns("id")}
        assert (found.manifest.source, found.manifest.policy, len(found)) == ("policy", policy, successes)
        rows = [*found.rows(), *found.failures()]
        log = [json.loads(line) for line in (kept / policy / "episodes.jsonl").read_text().splitlines()]
        told = {(one["scenario"], one["rollout"]): one["success"] for one in log}
        assert {(row.id, row.run): row.outcome == "success" for row in rows} == told
        assert all(row.style == "policy" and row.id in scenarios and len(row.witness) for row in rows)


def test_a_rollout_that_failed_is_filmed(kept, tmp_path, capsys):
    folder = kept / "random" / "rollouts" / REFERENCE.name
    (row, *_) = Demonstrations.open(folder).failures()
    film = [f"pool={folder}", f"id={row.id[:8]}", f"to={tmp_path / 'film.png'}", "frames=2", "width=64", "height=48"]
    assert cli.run(["show", "film", *film]) == 0 and (tmp_path / "film.png").stat().st_size
    assert f"{row.name}, run 0 (policy): {row.outcome} after {row.seconds:g} s: {row.reason}" in capsys.readouterr().out
    for wrong, says in (
        (["run=3"], "run = 3; of this scenario there are 0"),
        (["of=push_the_slab"], "of = push_the_slab; what is filmed of demonstrations is the run itself"),
        (["id=zzz"], f"no scenario in {folder} named 'zzz'"),
    ):
        assert cli.run(["show", "film", *film, *wrong]) == 2
        err = capsys.readouterr().err
        assert says in err and err.count("\n") == 1
    assert cli.run(["show", "film", f"pool={REFERENCE}", *film[1:], "run=0"]) == 2
    assert "a scenario of a pool has one witness" in capsys.readouterr().err


def test_a_prefix_of_several_ids_names_no_rollout(tmp_path, capsys):
    idle = ["policy=idle", "seeds=4", "rollouts=1", "keep=[episodes]", f"to={tmp_path / 'idle'}"]
    assert cli.run(["evaluate", f"pool={REFERENCE}", *idle]) == 0
    folder = tmp_path / "idle" / "rollouts" / REFERENCE.name
    start = next(a for a, b in pairwise(sorted(row.id[0] for row in Demonstrations.open(folder).attempts())) if a == b)
    capsys.readouterr()
    assert cli.run(["show", "film", f"pool={folder}", f"id={start}", f"to={tmp_path / 'film.png'}"]) == 2
    assert f"'{start}' is a prefix of 2 ids in {folder}" in capsys.readouterr().err


def test_kept_rollouts_replay_bit_for_bit(kept, capsys):
    for policy in ("oracle", "random"):
        assert cli.run(["verify", f"pool={kept / policy / 'rollouts' / REFERENCE.name}"]) == 0
        assert "sound: 2 of 2 replay bit for bit" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("changed", "says"), [({"policy": None}, "go together"), ({"operator": "op7"}, "an operator and a policy")]
)
def test_a_false_source_is_refused(kept, tmp_path, capsys, changed, says):
    folder, forged = kept / "random" / "rollouts" / REFERENCE.name, tmp_path / "forged"
    shutil.copytree(folder, forged)
    plain = {**json.loads((folder / DEMONSTRATIONS).read_text()), **changed}
    told = {name: value for name, value in plain.items() if value is not None}
    (forged / DEMONSTRATIONS).write_text(json.dumps(told))
    assert cli.run(["verify", f"pool={forged}"]) != 0
    assert says in capsys.readouterr().err


def test_rollouts_are_recorded_with_their_failures_on_request(kept, tmp_path):
    pools = ",".join(str(kept / policy / "rollouts" / REFERENCE.name) for policy in ("oracle", "random"))
    assert cli.run(["record", f"pool={pools}", f"to={tmp_path / 'all'}", "cameras=none", "failed=true"]) == 0
    table = pq.read_table(tmp_path / "all" / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    assert [one["scengen/success"] for one in table] == [True, True, False, False]
    assert {one["scengen/source"] for one in table} == {"policy"}
    rows = pq.read_table(tmp_path / "all" / "data" / "chunk-000" / "file-000.parquet")
    assert np.array(rows["next.done"].to_pylist()).sum() == 4 and np.array(rows["next.success"].to_pylist()).sum() == 2
    assert cli.run(["record", f"pool={pools}", f"to={tmp_path / 'good'}", "cameras=none"]) == 0
    assert json.loads((tmp_path / "good" / "meta" / "info.json").read_text())["total_episodes"] == 2


@pytest.mark.parametrize("rules", ["strict", "paper"])
def test_episodes_are_judged_by_the_rules_that_they_were_played_under(tmp_path, monkeypatch, capsys, rules):
    """A mean that every witness lacks: under the paper's rules the witnesses count, wherever they are judged."""
    early = {"it took 0.3 s at most": throughout(lambda world: world.time <= 0.3)}
    monkeypatch.setattr(DominoSingle, "means", lambda self: early)
    assert evaluate(tmp_path / "out", "policy=oracle", f"rules={rules}") == 0
    folder, data = tmp_path / "out" / "rollouts" / REFERENCE.name, tmp_path / "data"
    found = Demonstrations.open(folder)
    assert found.manifest.config.rules == rules and len(found) == (2 if rules == "paper" else 0)
    assert cli.run(["verify", f"pool={folder}"]) == 0
    assert cli.run(["record", f"pool={folder}", f"to={data}", "cameras=none", "failed=true"]) == 0
    table = pq.read_table(data / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    assert table["scengen/rules"].to_pylist() == [rules] * 2
    assert table["scengen/success"].to_pylist() == [rules == "paper"] * 2
    assert cli.run(["curate", f"data={data}"]) == 0
    assert json.loads((data / "curation" / "kept.json").read_text()) == ([0, 1] if rules == "paper" else [])


def test_rules_without_a_name_are_refused(kept, tmp_path, capsys):
    forged = tmp_path / "forged"
    shutil.copytree(kept / "oracle" / "rollouts" / REFERENCE.name, forged)
    plain = json.loads((forged / DEMONSTRATIONS).read_text())
    plain["config"]["rules"] = "none"
    (forged / DEMONSTRATIONS).write_text(json.dumps(plain))
    assert cli.run(["verify", f"pool={forged}"]) != 0
    assert "no rules named 'none'" in capsys.readouterr().err


def test_a_repeated_command_plays_nothing_again_and_writes_the_same_bytes(kept):
    before = rollouts(kept, "random").sha256
    assert evaluate(kept / "random", "policy=random") == 0
    assert rollouts(kept, "random").sha256 == before


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["keep=[pictures]"], "keep = pictures; it must be episodes"),
        (["settle=false"], "episodes are kept with settle=true alone"),
    ],
)
def test_what_cannot_be_kept_is_refused_before_anything_is_played(tmp_path, capsys, words, says):
    assert evaluate(tmp_path / "out", "policy=random", *words) == 2
    assert says in capsys.readouterr().err and not list(tmp_path.iterdir())
