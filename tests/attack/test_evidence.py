"""Attacks as part of certificates and pools, and the hits that they leave behind."""

import json
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from pools import make

from scengen import cli, load_task
from scengen.attack.campaign import AttackSettings, attack, drawn
from scengen.attack.check import attacked
from scengen.attack.evidence import OTHER_SCENARIO, Hit, Replayed, replayed
from scengen.errors import BadConfig
from scengen.pool import Pool
from scengen.pool.files import sha256
from scengen.predicates import touched_only
from scengen.runs.attempts import first_of
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


HITS = {
    "too fast": ({"seconds": 0.5}, "reaches the goal after 0.5 s; replayed, it takes"),
    "lacks a contact": ({"lacks": (("robot", "tile_0"),)}, "lacks the contact robot - tile_0, which it makes"),
    "lacks what is not there": ({"lacks": (("moon", "sun"),)}, "which the scene cannot have"),
    "moves the slab": ({"unmoved": ("slab",)}, "slab stays where it is, which moves"),
    "a body of another scene": ({"unmoved": ("moon",)}, "which is not a free body"),
}


@pytest.mark.parametrize("name", HITS)
def test_what_a_hit_says_is_compared_with_its_replay(attacked_pool, tmp_path, capsys, name):
    changed, says = HITS[name]
    hit = replace(Hit.load(next((attacked_pool / "hits").iterdir())), **changed)
    hit.store(tmp_path)
    assert cli.run(["verify", f"hits={tmp_path}"]) == 1
    told = capsys.readouterr().out
    assert says in told and "claimed, and not checked: how hits were found" in told


def test_a_hit_that_ends_in_other_bits_is_told_of(attacked_pool, tmp_path, capsys):
    replace(Hit.load(next((attacked_pool / "hits").iterdir())), digest="0" * 16, seconds=0.5).store(tmp_path)
    assert cli.run(["verify", f"hits={tmp_path}"]) == 0
    assert "ends in other bits than it says: it was found on another machine, or edited" in capsys.readouterr().out


def _rates(**entries):
    return lambda attack: [rate.update(entries) for rate in attack["rates"]]


ENTRIES = {
    "too few rollouts": (_rates(rollouts=0), "more hits than rollouts"),
    "many rollouts": (_rates(rollouts=10**9), "bound of the tier"),
    "no rate": (_rates(rate=0.0), "rate of the tier"),
    "refuting": (_rates(refuting=1), "refuting of the tier"),
    "sum": (lambda a: a.update(rollouts=10**9), "it says rollouts = 1000000000"),
    "twice": (lambda a: a["rates"].append(a["rates"][-1]), "it counts a tier twice"),
    "rules": (lambda a: a.update(rules="paper"), "it says rules = 'paper'"),
    "task": (lambda a: a.update(task="packing"), "it says task = 'packing'"),
    "version": (lambda a: a.update(task_version=7), "it says task_version = 7"),
    "scenarios": (lambda a: a.update(scenarios=["0" * 12]), "it names the scenarios 000000000000"),
    "losses": (lambda a: a.update(lost=["0" * 12 + " died"]), "it has losses of 000000000000"),
    "types": (lambda a: a.update(priors=5), "priors is not a list"),
    "more": (lambda a: a.update(reviewed=True), "it has an unknown entry 'reviewed'"),
    "no more hits": (lambda a: a.update(hits=[]), "counts a different number of hits"),
    "one hit twice": (lambda a: a["hits"].append({**a["hits"][0], "file": "hits/copy.npz"}), "is listed twice"),
}


@pytest.mark.parametrize("name", ENTRIES)
def test_entries_about_an_attack_that_contradict_each_other_are_refuted(attacked_pool, tmp_path, name, capsys):
    pool = Path(shutil.copytree(attacked_pool, tmp_path / "pool"))
    manifest = json.loads((pool / "manifest.json").read_text())
    shutil.copy(pool / manifest["attack"]["hits"][0]["file"], pool / "hits" / "copy.npz")
    change, says = ENTRIES[name]
    change(manifest["attack"])
    (pool / "manifest.json").write_text(json.dumps(manifest, indent=1, sort_keys=True) + "\n")
    assert cli.run(["verify", f"pool={pool}", "level=replay", f"json={tmp_path / 'told.json'}"]) == 1
    failed = json.loads((tmp_path / "told.json").read_text())["failed"]
    assert any(re.search(says, one["reason"]) for one in failed), failed


@pytest.mark.slow
def test_no_scenario_that_was_not_attacked_takes_the_place_of_a_refuted_one(tmp_path, monkeypatch):
    def refuting(job, settings, records, journal, progress):
        first = first_of(records, "certified", settings.n)[0]
        records[first] = replace(records[first], verdict="refuted", check="attack", reason="a way around")

    second = make(tmp_path / "pool", n=3).pool.at(1).index
    monkeypatch.setattr("scengen.runs.generate._attack", refuting)
    again = make(tmp_path / "pool", n=2, attack=4)
    assert [row.index for row in again.pool.rows()] == [second]


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


def test_hits_under_conditions_of_control_replay_under_them_alone(tmp_path):
    subjects = drawn(TASK, "payload@1", 1, 0)
    settings = AttackSettings(split="payload@1", budget=4, tiers=["witness"])
    report = attack(TASK, subjects, settings, tmp_path, lambda *_: None)
    assert report.hits
    for hit in report.hits:
        assert hit.conditions == "payload@1" and replayed(hit, TASK) == Replayed()
        assert replayed(replace(hit, conditions=""), TASK).fault == OTHER_SCENARIO
        assert replayed(replace(hit, conditions="payload@1+wide_gaps"), TASK).fault == OTHER_SCENARIO


def test_a_filtered_hit_says_whether_the_filter_can_give_its_actions_from_rest():
    still, sudden = np.zeros((3, 14), np.float32), np.zeros((3, 14), np.float32)
    sudden[1, 7] = 0.2  # the second arm
    about = ("0123456789ab", "witness"), ("a plan", 1.0, "0" * 16, (), (), {})
    found = [Hit(*about[0], raw, *about[1], actions) for raw in (False, True) for actions in (still, sudden)]
    assert [hit.resumed for hit in found] == [False, True, False, False]
    assert str(found[1]).startswith("by witness, filtered from a state of the witness on: a plan")


def test_a_hit_of_another_version_is_told_of(attacked_pool, tmp_path, capsys, monkeypatch):
    whole = next((attacked_pool / "hits").iterdir())
    hit = Hit.load(whole)
    now = TASK.version
    assert hit.task_version == now and Pool.open(attacked_pool).manifest.attack["task_version"] == now
    assert replayed(hit, TASK).fault == ""
    monkeypatch.setattr(TASK.family, "VERSION", now + 1)
    assert replayed(hit, TASK).fault == "", "a hit that still replays holds"
    told = replayed(replace(hit, actions=hit.actions[:-300] * 0), TASK).fault
    assert told.endswith(f"(found on version {now} of domino_single; installed: {now + 1})")
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
