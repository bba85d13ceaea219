"""Every task behaves as it is stored, whatever its code looks like; what is stored changes only with its version."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from helpers import of_stored_pools

from scengen import list_tasks, load_task
from scengen.episode import Episode
from scengen.evidence import comparison, episodes, rules
from scengen.evidence.behaviour import FORMAT, SEED, Behaviour, current_rules, is_core, packed, unpacked
from scengen.evidence.comparison import compare, merged, same_machine
from scengen.evidence.edges import Edge
from scengen.evidence.rollouts import Stage
from scengen.scenario import Shortcut
from scengen.tasks import domino_single
from scengen.tasks.domino_single import DominoSingle

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "conf" / "behaviour"
HANDS = ROOT / "tests" / "attack"
MAX_BYTES = 1_000_000
"""Largest size of all files: people review their differences."""
REMEDY = "python tools/behaviour.py write {}; if verdicts, draws, scenes or rules differ, raise VERSION first"


def stored(task):
    return Behaviour.read(FOLDER / f"{task}.json")


def cheats(task, monkeypatch):
    """Kept cheats of a task, which the tests of the adversary hold."""
    monkeypatch.syspath_prepend(str(HANDS))
    if not (HANDS / "hands" / f"{task}.py").is_file():
        return {}
    return {name: (hand.plan, hand.raw) for name, hand in import_module(f"hands.{task}").HANDS.items()}


@of_stored_pools
@pytest.mark.each_change
@pytest.mark.parametrize("task", list_tasks())
def test_a_task_behaves_as_it_is_stored(task, monkeypatch):
    known = cheats(task, monkeypatch)
    found = compare(load_task(task), stored(task), lambda name: is_core(name) or name.startswith("cheat"), known)
    wanted = ("version", "bits", "new") if found.same_machine else ("version",)
    told = [str(difference) for difference in found.differences if difference.level in wanted]
    assert not told, "\n".join([*told, REMEDY.format(task)])


def test_every_task_is_stored_and_the_files_are_small():
    assert sorted(path.stem for path in FOLDER.glob("*.json")) == list_tasks()
    assert sum(path.stat().st_size for path in FOLDER.glob("*.json")) < MAX_BYTES


def test_a_cheat_is_stored_for_each_one_that_is_kept(monkeypatch):
    for task in list_tasks():
        names = {name.removeprefix("id 0 cheat ") for name in stored(task).rollouts if " cheat " in name}
        assert names == set(cheats(task, monkeypatch)), task


OPEN = {("packing", "id 0 cheat try_places")}
"""Kept cheats that reach the goal in the stored draw, although most draws are closed to them. A guess of one of the
twelve arrangements of `packing` is right in a tenth of the draws: each piece of this one goes in at its first try."""


def test_no_kept_cheat_and_no_shortcut_reaches_the_goal():
    ways = (" cheat ", " shortcut ", " idle", " ablation ")
    played = {(task, name): result[0] for task in list_tasks() for name, result in stored(task).rollouts.items()}
    reached = {way for way, verdict in played.items() if verdict == "success" and any(w in way[1] for w in ways)}
    assert reached == OPEN


def test_a_higher_version_has_a_line_under_draws():
    text = (ROOT / "CHANGELOG.md").read_text()
    draws = "\n".join(re.findall(r"^### Draws\n(.*?)(?=^##|\Z)", text, re.M | re.S))
    for task in list_tasks():
        version = load_task(task).version
        said = any(f"{name}: version {version}" in draws for name in (task, "all tasks"))
        assert version == 1 or said, f"{task}: version {version}: say under Draws why"


def of_version(plain):
    """The parts of a file that a version fixes. Entries of new axes may be added."""
    fixed = {name: plain.get(name) for name in ("reasons", "constraints", "answers", "contacts", "states", "limits")}
    played = {name: result[0] for name, result in plain["rollouts"].items() if result[-1] != "unsteady"}
    return fixed, {**plain["declared"], **plain["draws"], **played}


def test_a_file_changes_only_with_its_version():
    """No revision of a file has other draws, scenes, rules or verdicts under the version of the revision before."""

    def git(*arguments):
        return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True)

    if git("rev-parse", "HEAD").returncode:
        pytest.skip("no git repository: revisions of the files are not there to compare")
    for path in sorted(FOLDER.glob("*.json")):
        revisions = git("log", "--format=%H", "-n", "10", "--", str(path)).stdout.split()
        texts = [path.read_text(), *(git("show", f"{each}:{path.relative_to(ROOT)}").stdout for each in revisions)]
        plain = [json.loads(text) for text in texts if text]
        for new, old in pairwise(plain):
            if (new["version"], new["format"]) == (old["version"], old["format"]):
                (fixed, now), (fixed_before, before) = of_version(new), of_version(old)
                assert fixed == fixed_before, path.stem
                assert not {name for name in before if now.get(name) != before[name]}, path.stem


# --- what is noticed --------------------------------------------------------------------------------------------------


def kinds(found):
    return {(difference.kind, difference.level) for difference in found.differences}


def nothing(name):
    return False


@pytest.fixture(scope="module")
def task():
    return load_task("domino_single")


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("HOLD", "declared value"),
        ("VERSION", "version"),
    ],
)
def test_a_declared_value_is_noticed(task, monkeypatch, name, kind):
    monkeypatch.setattr(DominoSingle, name, 2)
    assert (kind, "version") in kinds(compare(task, stored(task.name), nothing))


def test_another_time_limit_is_noticed(task):
    found = compare(replace(task, horizon=1.02 * task.horizon), stored(task.name), nothing)
    assert [(d.kind, d.what) for d in found.differences] == [("declared value", "horizon")]


@pytest.mark.parametrize("factor", [1.02, 0.98])
def test_a_limit_that_moves_by_two_percent_is_noticed_without_a_rollout(task, monkeypatch, factor):
    monkeypatch.setattr(domino_single, "SLAB_DISPLACEMENT", factor * domino_single.SLAB_DISPLACEMENT)
    found = compare(task, stored(task.name), nothing)
    assert ("success or failure", "version") in kinds(found)


def test_a_rule_that_is_lifted_is_noticed(task, monkeypatch):
    monkeypatch.setattr(DominoSingle, "failure", lambda self, world: None)
    assert ("success or failure", "version") in kinds(compare(task, stored(task.name), nothing))


def test_a_looser_constraint_is_noticed(task, monkeypatch):
    monkeypatch.setattr(domino_single, "on_table", lambda what, points, margin=0.0: None)
    assert ("constraint", "version") in kinds(compare(task, stored(task.name), nothing))


def test_a_heavier_slab_is_another_scene(task, monkeypatch):
    build = DominoSingle.build

    def heavier(self):
        scene = build(self)
        scene.body("slab").geoms[0].mass *= 1.02
        return scene

    monkeypatch.setattr(DominoSingle, "build", heavier)
    assert ("scene", "version") in kinds(compare(task, stored(task.name), nothing))


def test_a_slower_oracle_has_other_bits_and_the_same_verdict(task, monkeypatch):
    before = stored(task.name)
    if not same_machine(before):
        pytest.skip("another machine than that of the file: bits are not compared")
    oracle = DominoSingle.oracle

    def later(self, world):
        yield world.idle
        yield from oracle(self, world)

    monkeypatch.setattr(DominoSingle, "oracle", later)
    found = compare(task, before, nothing)
    assert kinds(found) == {("oracle", "bits")} and found.reproduces == "verdicts"


def test_a_shortcut_that_reaches_the_goal_is_another_verdict(task, monkeypatch):
    shortcuts = DominoSingle.shortcuts

    def solved(self):
        return {name: Shortcut(self.oracle, each.to_rest) for name, each in shortcuts(self).items()}

    monkeypatch.setattr(DominoSingle, "shortcuts", solved)
    found = compare(task, stored(task.name), lambda name: name.startswith("shortcut") and not name.endswith("raw"))
    assert ("shortcut", "version") in kinds(found)


def test_another_controller_on_the_same_machine_is_noticed(task, monkeypatch):
    """The fingerprint is that of machine and controller together: a change of one must not pass for the other."""
    before = stored(task.name)
    if not same_machine(before):
        pytest.skip("another machine than that of the file: bits are not compared")
    monkeypatch.setattr(comparison, "fingerprint", lambda: "0" * 16)
    assert ("controller", "bits") in kinds(compare(task, before, nothing))


def test_another_order_of_rules_is_noticed(monkeypatch):
    judge = Episode.judge

    def goal_first(self):
        if self.outcome is None and self.scenario.success(self.world):
            monkeypatch.setattr(self.scenario, "now", (True, None, True))
        return judge(self)

    episodes.episodes_sha256.cache_clear()
    before = episodes.episodes_sha256()
    monkeypatch.setattr(Episode, "judge", goal_first)
    episodes.episodes_sha256.cache_clear()
    assert episodes.episodes_sha256() != before
    episodes.episodes_sha256.cache_clear()
    assert before == stored("domino_single").declared["episodes"]


# --- parts ------------------------------------------------------------------------------------------------------------


def test_a_state_survives_its_text(task):
    state = Stage(task.draw("id", SEED, 0).scenario, task.embodiment, task.horizon).world.state()
    assert np.allclose(unpacked(packed(state)), state, rtol=1e-6, atol=1e-6)


def test_rules_say_the_same_whenever_they_are_asked(task):
    """Whatever a probe changes, it sets back."""
    before = stored(task.name)
    stage = Stage(task.draw("id", SEED, 0).scenario, task.embodiment, task.horizon)
    once, again = current_rules(stage, before), current_rules(stage, before)
    assert once == again == {name: getattr(before, name) for name in once}


def test_a_limit_is_between_the_places_at_which_the_rules_are_asked(task):
    before = stored(task.name)
    stage = Stage(task.draw("id", SEED, 0).scenario, task.embodiment, task.horizon)
    assert before.limits
    contacts = [rules.Contact(*each) for each in before.contacts]
    for state, text, magnitude, low, high, _ in before.limits:
        probe = rules.Probe(stage.scenario, stage.world, unpacked(before.states[state]["state"]), contacts)
        sides = probe.around(rules.Place.parse(text), magnitude)
        assert [list(side) for side in sides] == [[before.answers[k] for k in each] for each in (low, high)]
        assert low != high


def test_a_constraint_is_stored_on_both_sides_of_its_limit(task):
    start = [task.draw("id", SEED, index).scenario for index in range(3)]
    before = stored(task.name)
    for plain in before.constraints:
        edge = Edge.of(plain, before.reasons)
        assert edge.again(start[edge.start]) == edge and edge.before != edge.after
        assert edge.plain([*before.reasons]) == plain


def test_writing_again_keeps_states_and_marks(task):
    before = stored(task.name)
    played = {name: [*result[:2], "0" * 8] for name, result in before.rollouts.items()}
    marked = replace(before, rollouts={**before.rollouts, "id 0 idle": ["timeout", 1.0, "1" * 8, "unsteady"]})
    again = merged(marked, replace(before, rollouts=played, states=[], limits=[], constraints=[]))
    assert (again.states, again.limits, again.constraints) == (before.states, before.limits, before.constraints)
    assert again.rollouts["id 0 idle"][2:] == ["0" * 8, "unsteady"] and again.rollouts["id 0 oracle"][2] == "0" * 8


@pytest.mark.parametrize("change", [{"format": FORMAT + 1}, {"task": None}, {"states": None}])
def test_a_file_that_is_none_is_refused(tmp_path, change):
    plain = json.loads((FOLDER / "domino_single.json").read_text())
    plain |= {name: value for name, value in change.items() if value is not None}
    for name in [name for name, value in change.items() if value is None]:
        del plain[name]
    path = tmp_path / "domino_single.json"
    path.write_text(json.dumps(plain))
    with pytest.raises(Exception, match="another format|is not of format|damaged"):
        Behaviour.read(path)


def test_the_tool_refuses_other_rules_under_the_same_version(monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    tool = import_module("behaviour")
    monkeypatch.setattr(DominoSingle, "failure", lambda self, world: None)
    text = (FOLDER / "domino_single.json").read_text()
    assert tool.write("domino_single") == 1
    assert "refused: raise VERSION" in capsys.readouterr().out
    assert (FOLDER / "domino_single.json").read_text() == text
    sys.modules.pop("behaviour")
