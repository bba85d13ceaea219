"""Attacks as part of certificates and pools, and the hits that they leave behind."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from scengen import cli, load_task
from scengen.attack.campaign import drawn
from scengen.attack.check import attacked
from scengen.attack.evidence import Hit, unsound
from scengen.errors import BadConfig
from scengen.pool import Pool
from scengen.pool.files import sha256
from scengen.predicates import touched_only
from scengen.validate.certify import certify
from scengen.validate.settings import QUICK, Robust

TASK = load_task("domino_single")


@pytest.fixture(scope="module")
def subject():
    return drawn(TASK, "id", 1, 0)[0]


def test_full_certificates_tell_of_an_attack_and_quick_ones_that_there_was_none(subject):
    scenario = subject.scenario
    settings = replace(QUICK, attack=4, robust=Robust(runs=1, bound=0.04))
    checks = certify(scenario, TASK.horizon, settings, adversary=attacked).certificate
    assert checks.verdict == "certified" and sum(n["rollouts"] for n in checks["attack"].numbers.values()) == 4
    with pytest.raises(BadConfig, match=r"pass adversary=scengen\.attack\.check\.attacked"):
        certify(scenario, TASK.horizon, settings)


@pytest.mark.slow
def test_an_attack_in_a_certificate_refutes_where_there_is_a_way_around(subject):
    """Without the rule on carrying, the first tile itself can be used on the slab."""
    settings = replace(QUICK, attack=60, robust=Robust(runs=1, bound=0.04))
    rules = {"failure": lambda self, world: touched_only(world, "tile_0"), "shortcuts": lambda self: {}}
    with mock.patch.multiple(TASK.family, **rules):
        certificate = certify(subject.scenario, TASK.horizon, settings, adversary=attacked).certificate
    assert certificate.verdict == "refuted" and certificate.reason.startswith("attack: a way around, by ")


@pytest.fixture(scope="module")
def attacked_pool(tmp_path_factory):
    folder = tmp_path_factory.mktemp("attacked") / "pool"
    quickly = ["certify.robust.runs=1", "certify.robust.bound=0.04"]
    assert cli.run(["generate", "task=domino_single", "n=1", "attack=20", f"pool={folder}", *quickly]) == 0
    return folder


@pytest.mark.slow
def test_a_pool_tells_of_an_attack_and_its_hits_replay(attacked_pool, capsys):
    told = Pool.open(attacked_pool).manifest.attack
    assert (
        told["rollouts"] == 20 and told["hits"] and len(list((attacked_pool / "hits").iterdir())) == len(told["hits"])
    )
    assert cli.run(["verify", f"pool={attacked_pool}", "level=replay"]) == 0
    assert cli.run(["verify", f"hits={attacked_pool / 'hits'}"]) == 0
    assert f"{len(told['hits'])} of {len(told['hits'])} hits replay" in capsys.readouterr().out


@pytest.mark.parametrize("forged", ["count", "actions", "another hit", "refuting"])
def test_a_false_hit_in_a_pool_is_noticed(attacked_pool, tmp_path, forged):
    pool = Path(shutil.copytree(attacked_pool, tmp_path / "pool"))
    manifest = json.loads((pool / "manifest.json").read_text())
    entry = manifest["attack"]["hits"][0]
    path = pool / entry["file"]
    hit = Hit.load(path)
    if forged == "count":
        manifest["attack"]["rates"][0]["hits"] += 1
    elif forged == "another hit":
        path.write_bytes((pool / manifest["attack"]["hits"][1]["file"]).read_bytes())
    else:
        changed = {"actions": {"actions": hit.actions[:-300] * 0}, "refuting": {"lacks": (("tile_0", "tile_1"),)}}
        replace(hit, **changed[forged]).store(tmp_path)
        path.write_bytes((tmp_path / path.name).read_bytes())
        entry.update(json.loads(json.dumps(replace(hit, **changed[forged]).plain())), sha256=sha256(path.read_bytes()))
    (pool / "manifest.json").write_text(json.dumps(manifest, indent=1, sort_keys=True) + "\n")
    assert cli.run(["verify", f"pool={pool}", "level=replay"]) == 1


@pytest.mark.parametrize("content", [b"", b"no zip", b"PK\x03\x04" + bytes(60)])
def test_a_file_that_is_no_hit_is_one_clear_error(tmp_path, content, capsys):
    (tmp_path / "hit.npz").write_bytes(content)
    assert cli.run(["verify", f"hits={tmp_path / 'hit.npz'}"]) == 2
    assert "is not a hit of scengen attack" in capsys.readouterr().err


CHANGES = {
    "params are null": {"params": None},
    "a parameter is a text": {"params": {"count": "three"}},
    "the scenario climbs": {"scenario": "../../x"},
    "a tier of its own": {"tier": "<b>sure</b>\n"},
    "raw is a number": {"raw": 1},
    "a text for a time": {"seconds": "2"},
    "an endless time": {"seconds": 1e9},
    "no digest": {"digest": None},
    "contacts of three": {"lacks": [["a", "b", "c"]]},
    "contacts are a text": {"lacks": "ab"},
    "bodies are numbers": {"unmoved": [3]},
    "one more": {"more": 1},
    "a task that is a list": {"task": []},
    "version 0": {"task_version": 0},
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("command", ["verify hits={hit}", "film hit={hit} to={to}"])
def test_what_a_hit_says_is_checked_before_it_is_used(attacked_pool, tmp_path, capsys, command, change):
    whole = next((attacked_pool / "hits").iterdir())
    with np.load(whole) as stored:
        about = {**json.loads(str(stored["about"])), **CHANGES[change]}
        np.savez_compressed(tmp_path / "hit.npz", actions=stored["actions"], about=json.dumps(about))
    argv = command.format(hit=tmp_path / "hit.npz", to=tmp_path / "strip.png").split()
    assert cli.run(argv) == 2
    assert "is not a hit of scengen attack, or is damaged: " in capsys.readouterr().err.splitlines()[-1]


def test_a_hit_of_another_version_is_told_of(attacked_pool, tmp_path, capsys, monkeypatch):
    whole = next((attacked_pool / "hits").iterdir())
    hit = Hit.load(whole)
    assert hit.task_version == 1 and Pool.open(attacked_pool).manifest.attack["task_version"] == 1
    assert unsound(hit, TASK) == ""
    monkeypatch.setattr(TASK.family, "VERSION", 2)
    assert unsound(hit, TASK) == "", "a hit that still replays holds"
    told = unsound(replace(hit, actions=hit.actions[:-300] * 0), TASK)
    assert told.endswith("(found on version 1 of domino_single; installed: 2)")
    with np.load(whole) as stored:  # as earlier releases wrote it
        about = json.loads(str(stored["about"]))
        del about["task_version"]
        np.savez_compressed(tmp_path / "hit.npz", actions=stored["actions"], about=json.dumps(about))
    assert Hit.load(tmp_path / "hit.npz").task_version is None


@pytest.mark.parametrize("command", ["verify hits={hit}", "film hit={hit} to={to}"])
def test_a_pipe_is_no_hit(tmp_path, capsys, command):
    os.mkfifo(tmp_path / "hit.npz")
    argv = command.format(hit=tmp_path / "hit.npz", to=tmp_path / "strip.png").split()
    assert cli.run(argv) == 2
    assert "is not a plain file" in capsys.readouterr().err


def test_a_hit_that_is_missing_is_one_line(tmp_path, capsys):
    assert cli.run(["verify", f"hits={tmp_path / 'none.npz'}"]) == 2
    assert "it is missing; give one that scengen attack has stored" in capsys.readouterr().err


def test_a_scenario_that_ends_its_process_is_unknown_and_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("scengen.attack.campaign.player_of", lambda subject, rules: os._exit(3))
    argv = ["attack", "task=domino_single", "n=1", "budget=2", "tiers=[random]", f"to={tmp_path}"]
    assert cli.run(argv) == 2
    assert "unknown: the attack on" in capsys.readouterr().out


def test_a_run_that_certifies_nothing_has_nothing_to_attack(tmp_path, capsys):
    argv = ["generate", "task=domino_single", "n=1", "limit=1", "attack=4", "task.horizon=0.05"]
    assert cli.run([*argv, f"pool={tmp_path / 'pool'}"]) == 1
    assert "only 0 of 1 could be certified" in capsys.readouterr().err
