"""False claims in pools whose hashes are right: each is noticed, with its reason.

Rows are forged from the reference pool and from pools of two other tasks, and examined in this process. Most are found
without simulation; where the physics was touched that is what matters.
"""

import copy
import json
import os
import re
import shutil
import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers import REFERENCE, of_stored_pools
from pools import certificate_of

from scengen import cli, compose, load_task
from scengen.certificate import as_json, from_json
from scengen.errors import PoolError
from scengen.pool import Pool
from scengen.pool.files import sha256
from scengen.pool.writing import write_pool
from scengen.validate.certify import Trial
from scengen.validate.verify.claims import Claims
from scengen.validate.verify.junit import junit
from scengen.validate.verify.pools import Examiner, Options, _Run, verify
from scengen.validate.verify.spot import bound, excluded_share, possible_false
from scengen.validate.verify.stored import settings_of_manifest, task_of_manifest
from scengen.work.parallel import Limits

pytestmark = of_stored_pools
SHARD = "scenarios-00000.parquet"
BASE = Path(__file__).parents[1] / "checker" / "base"
SOURCES = {"single": REFERENCE, "cage": BASE / "cage_id", "tool": BASE / "tool_id"}


@cache
def opened(source):
    return Pool.open(SOURCES[source])


@cache
def rows(source):
    return tuple(opened(source).rows())


task = cache(load_task)


@cache
def claims(source):
    of = opened(source)
    return Claims.of(of, task_of_manifest(of, task(of.task)), settings_of_manifest(of.manifest))


def reasons(source, row, level="replay", simulated=False):
    return Examiner(claims(source), level, False)((row, simulated, True)).reasons


# --- forgeries ----------------------------------------------------------------------------------------


def scene(pattern, new):
    """Another scene under a right hash."""

    def forge(row):
        text, count = re.subn(pattern, new, row.scene_xml, count=1, flags=re.S)
        assert count and text != row.scene_xml
        forged = sha256(text)
        return certificate_of(replace(row, scene_xml=text, scene_sha256=forged), scene_sha256=forged)

    return forge


def adds(element, to="mujoco"):
    return scene(f"</{to}>", f"{element}</{to}>")


def elsewhere(forge):
    """The same on a machine that nobody has: bits cannot be compared."""
    return lambda row: certificate_of(forge(row), fingerprint="0123456789abcdef")


def row_with(**columns):
    return lambda row: replace(row, **columns)


def certificate_with(**fields):
    return lambda row: certificate_of(row, **fields)


def check(name, **columns):
    def forge(row):
        checks = [replace(c, **columns) if c.name == name else c for c in row.certificate.checks]
        return certificate_of(row, checks=tuple(checks))

    return forge


def numbers(name, **changed):
    return lambda row: check(name, numbers={**of(row, name).numbers, **changed})(row)


def settings(name, **changed):
    return lambda row: check(name, settings={**of(row, name).settings, **changed})(row)


def of(row, name):
    return next(c for c in row.certificate.checks if c.name == name)


def first_of(name, **changed):
    """Other numbers of the first shortcut or ablation."""

    def forge(row):
        found = of(row, name).numbers
        first = min(found)
        return check(name, numbers={**found, first: {**found[first], **changed}})(row)

    return forge


def fewer(name):
    def forge(row):
        found = dict(of(row, name).numbers)
        del found[min(found)]
        return check(name, numbers=found)(row)

    return forge


def checks(choose):
    return lambda row: certificate_of(row, checks=tuple(choose(list(row.certificate.checks))))


def witness(change):
    """Other actions under a right hash, and as many as the certificate says."""

    def forge(row):
        actions = np.asarray(change(row.witness.copy()), np.float32)
        forged = sha256(actions.tobytes())
        row = certificate_of(replace(row, witness=actions, witness_sha256=forged), witness_sha256=forged)
        return numbers("witness", periods=len(actions))(row)

    return forge


def parameter(name, by):
    """A scenario that was not drawn, with the scene and the id that belong to it."""

    def forge(row):
        from scengen.validate.rebuilt import rebuild

        params = {**row.params, name: row.params[name] * by}
        scenario = task(row.task).scenario(params)
        text = rebuild(scenario)
        forged = sha256(text)
        row = replace(row, params=params, id=scenario.id, id_twin=scenario.id, scene_xml=text, scene_sha256=forged)
        return certificate_of(check("feasible", numbers=dict(scenario.features()))(row), scene_sha256=forged)

    return forge


def jerk(actions):
    actions[-20:, 2] = np.where(np.arange(20) % 2, 1.0, -1.0)
    return actions


def beyond(actions):
    actions[10, 3] = 1.2
    return actions


SCENE, DRAWN, COMPLETE = "scene is not the one", "the parameters are not those that are drawn", "not complete"
EXCLUDE = '<contact><exclude body1="{}" body2="gripper0_right_leftfinger"/></contact>'
MOTOR = '<actuator><motor name="more" joint="robot0_joint1"/></actuator>'
WALL = '<geom type="box" size="0.01 0.3 0.3" pos="0.39 0 1.1" rgba="0 0 0 0"/>'
SPRING = '<body name="cart" pos="0 0.3 0.9"><joint type="slide" stiffness="60"/><geom size="0.02" mass="1"/></body>'

FALSE = {
    # the scene
    "gravity sideways": (scene("<option ", '<option gravity="0 5 -9.81" '), SCENE),
    "wind": (scene("<option ", '<option wind="0 8 0" '), SCENE),
    "time step": (scene("<option ", '<option timestep="1e-9" '), SCENE),
    "iterations": (scene("<option ", '<option iterations="1000000000" tolerance="0" '), SCENE),
    "leaning slab": (scene('(<body name="slab"[^>]*) quat="[^"]*"', r'\1 euler="0 0.45 0"'), SCENE),
    "table that ends": (scene('(name="table_top" size=)"0.4 0.4', r'\1"0.4 0.15'), SCENE),
    "spring behind the slab": (adds(SPRING, "worldbody"), SCENE),
    "robot contacts excluded": (adds(EXCLUDE.format("tile_1")), SCENE),
    "motors on the robot": (adds(MOTOR), SCENE),
    "invisible wall": (adds(WALL, "worldbody"), SCENE),
    "million bodies": (
        adds('<replicate count="1000000"><body><geom size="1"/></body></replicate>', "worldbody"),
        SCENE,
    ),
    "lighter slab": (scene('(name="slab/box"[^>]*mass=")[^"]*', r"\g<1>0.03"), SCENE),
    "green slab": (scene('(name="slab/box"[^>]*rgba=")[^"]*', r"\g<1>0 1 0 1"), SCENE),
    "comment": (scene("<worldbody>", "<!-- certified --><worldbody>"), SCENE),
    "include": (adds('<include file="/etc/passwd"/>'), "contains <include>"),
    "entity": (lambda row: scene("<mujoco", '<!DOCTYPE m [<!ENTITY a "b">]><mujoco')(row), "document type or entities"),
    "gravity sideways elsewhere": (elsewhere(scene("<option ", '<option gravity="0 5 -9.81" ')), SCENE),
    "lighter slab elsewhere": (elsewhere(scene('(name="slab/box"[^>]*mass=")[^"]*', r"\g<1>0.0599")), SCENE),
    "exclude elsewhere": (elsewhere(adds(EXCLUDE.format("slab"))), SCENE),
    # labels
    "task": (row_with(task="packing"), "the task is 'packing'"),
    "code": (row_with(code="T99"), "the code is 'T99'"),
    "category": (row_with(category="P1"), "the category is"),
    "instruction": (row_with(instruction="Do nothing."), "the instruction is"),
    "horizon": (row_with(horizon=100.0), "the horizon is"),
    "split": (row_with(split="diagonal"), "the split is 'diagonal'"),
    "ID labelled OOD": (row_with(split="diagonal", axes=("diagonal",)), "the axes is"),
    "shifted": (row_with(shifted={"heading": 90.0}), "the shifted is"),
    "seed": (row_with(seed=5), "the seed is 5"),
    "index": (row_with(index=3), DRAWN),
    "index beyond": (row_with(index=77), "the index 77 is none of the"),
    "attempt": (row_with(attempt=4), "the attempt is 4"),
    "twin": (row_with(id_twin="0123456789ab"), "the id_twin is"),
    "embodiment": (row_with(embodiment="panda_suction"), "the embodiment is"),
    "id": (row_with(id="0123456789ab"), "the id does not belong"),
    "hand-picked": (parameter("tile.mass", 1.01), DRAWN),
    # the certificate
    "one check only": (checks(lambda c: c[-1:]), COMPLETE),
    "no check": (checks(lambda c: []), COMPLETE),
    "idle left out": (checks(lambda c: [k for k in c if k.name != "idle"]), COMPLETE),
    "order": (checks(lambda c: [c[1], c[0], *c[2:]]), COMPLETE),
    "check twice": (checks(lambda c: [*c, c[3]]), COMPLETE),
    "check failed": (check("robust", passed=False), COMPLETE),
    "check skipped": (check("robust", passed=None), COMPLETE),
    "verdict": (certificate_with(verdict="refuted"), COMPLETE),
    "passed with a reason": (check("robust", reason="1 of 4"), "gives a reason against it"),
    "level": (certificate_with(settings="full"), "the settings is 'full'"),
    "versions": (certificate_with(versions={"mujoco": "9", "robosuite": "9"}), "the versions is"),
    "source": (certificate_with(source_sha256="0" * 64), "the source_sha256 is"),
    "fingerprint": (certificate_with(fingerprint="0" * 16), "the fingerprint is"),
    "lenient rest": (settings("rest", drift=0.5), "check rest was made with other settings"),
    "short idle": (settings("idle", horizon=0.1), "check idle was made with other settings"),
    "short settling": (settings("witness", settle=0.01), "check witness was made with other settings"),
    "small jitter": (settings("robust", position=0.0), "check robust was made with other settings"),
    "drift beyond": (numbers("rest", drift=0.02), "check rest cannot"),
    "overlap beyond": (numbers("overlap", deepest=0.01), "check overlap cannot"),
    "one of four": (numbers("robust", solved=1), "check robust cannot"),
    "bound": (numbers("robust", bound=0.99), "check robust cannot"),
    "idle solves": (numbers("idle", outcome="success"), "check idle cannot"),
    "shortcut solves": (first_of("shortcuts", outcome="success"), "check shortcuts cannot"),
    "shortcut not told": (fewer("shortcuts"), "check shortcuts cannot"),
    "ablation solves": (first_of("ablations", outcome="success"), "check ablations cannot"),
    "ablation not told": (fewer("ablations"), "check ablations cannot"),
    "features": (fewer("feasible"), "check feasible cannot"),
    "numerics flip": (numbers("numerics", half_time_step={"witness": "timeout"}), "check numerics cannot"),
    "numerics half told": (fewer("numerics"), "check numerics cannot"),
    "oracle timed out": (numbers("solved", outcome="timeout"), "check solved cannot"),
    "after the horizon": (numbers("solved", seconds=99.0), "check solved cannot"),
    "sooner": (numbers("witness", seconds=0.5), "check witness cannot"),
    # the witness
    "jerk": (witness(jerk), "teleoperation filter cannot give"),
    "beyond one": (witness(beyond), "teleoperation filter cannot give"),
}
"""False claims that are told without simulation."""

SIMULATED = {
    "nothing": (witness(lambda a: a[:0]), "check witness", "replay"),
    "half of it": (witness(lambda a: a[: len(a) // 3]), "check witness", "replay"),
    "tail": (witness(lambda a: np.vstack([a, np.zeros((100, 7))])), "check witness|filter", "replay"),
    "final state": (certificate_with(final_state="0" * 16), "ends in another state", "replay"),
    "counts": (numbers("compiles", bodies=3), "check compiles has other numbers", "replay"),
    "stiller than it is": (numbers("rest", drift=1e-12), "check rest has other numbers", "recheck"),
    "idle ends sooner": (numbers("idle", seconds=0.3), "check idle has other numbers", "recheck"),
    "ablation ends sooner": (first_of("ablations", seconds=0.1), "check ablations has other numbers", "recheck"),
    "numerics by oracle": (
        numbers("numerics", half_time_step={"witness": "timeout", "oracle": "success"}),
        "check numerics has other numbers",
        "recheck",
    ),
}
"""False claims that need simulation, and the least level at which they are noticed."""

OTHERS = ("code", "horizon", "instruction", "seed", "comment", "wind", "motors on the robot", "idle left out", "jerk",
          "ablation not told", "shortcut not told", "lenient rest", "attempt", "twin", "level",
          "bound")  # fmt: skip


@pytest.mark.parametrize("name", FALSE)
def test_a_false_claim_is_noticed(name):
    forge, says = FALSE[name]
    found = reasons("single", forge(rows("single")[0]))
    assert any(re.search(says, reason) for reason in found), found


@pytest.mark.parametrize("name", SIMULATED)
def test_a_false_claim_about_the_physics_is_noticed(name):
    forge, says, level = SIMULATED[name]
    found = reasons("single", forge(rows("single")[1]), level, simulated=True)
    assert any(re.search(says, reason) for reason in found), found


@pytest.mark.parametrize(("factor", "sound"), [(1 + 1e-12, True), (1 + 1e-6, False)])
def test_a_number_may_differ_in_its_last_digits_as_numpy_rounds_on_another_processor(factor, sound):
    row = rows("single")[1]
    drift = next(one for one in row.certificate.checks if one.name == "rest").numbers["drift"]
    found = reasons("single", numbers("rest", drift=factor * drift)(row), "recheck", simulated=True)
    assert (not found) is sound


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("source", ["cage", "tool"])
def test_a_false_claim_about_another_task_is_noticed(source, name):
    forge, says = FALSE[name]
    assert any(re.search(says, reason) for reason in reasons(source, forge(rows(source)[0])))


@pytest.mark.parametrize("source", SOURCES)
def test_a_row_as_it_was_made_is_sound(source):
    assert reasons(source, rows(source)[0], "replay", simulated=source != "tool") == ()


def test_every_check_without_an_oracle_comes_out_with_the_same_numbers():
    assert reasons("single", rows("single")[0], "recheck", simulated=True) == ()


@cache
def shortcuts_made_again(to_the_end):
    """Numbers of the check of shortcuts of a row, made as now or as in earlier releases."""
    row, of_pool = rows("single")[0], claims("single")
    scenario = of_pool.task.scenario(row.params)
    trial = Trial(scenario, row.horizon, of_pool.settings, row.embodiment, to_the_end=to_the_end)
    trial.check("compiles")
    return from_json(as_json(trial.check("shortcuts").numbers))


@pytest.mark.parametrize("to_the_end", [False, True])
@pytest.mark.parametrize("forged", [False, True])
def test_shortcuts_that_were_played_to_their_end_are_accepted_and_forged_ones_are_not(to_the_end, forged):
    told = copy.deepcopy(shortcuts_made_again(to_the_end))
    assert told != shortcuts_made_again(not to_the_end)
    if forged:
        next(iter(told.values()))["raw"]["seconds"] += 0.01
    row = check("shortcuts", numbers=told)(rows("single")[0])
    found = reasons("single", row, "full", simulated=True)
    assert bool(found) is forged and all("check shortcuts has other numbers" in reason for reason in found)


# --- pools ----------------------------------------------------------------------------------------------


@pytest.fixture
def mine(tmp_path):
    return Path(shutil.copytree(REFERENCE, tmp_path / "mine"))


def report(folder, **options):
    of = Pool.open(folder)
    asked = {"level": "replay", "limits": None, "sample": 1, **options}
    return verify(of, task(of.task), compose.certify_levels(task(of.task)), Options(**asked))


def changed(folder, change):
    """Change the manifest."""
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text())
    change(manifest)
    path.write_text(json.dumps(manifest))


MANIFEST = {
    "funnel": (lambda m: m["funnel"].update(certified=40), "the funnel differs"),
    "proposed": (lambda m: m["funnel"].update(proposed=200), "the funnel differs"),
    "a stage left out": (lambda m: m["funnel"].pop("robust"), "the funnel differs"),
    "n": (lambda m: m.update(n=1), "says n = 1"),
    "indices fewer": (lambda m: m.update(indices=1), "none of the 1 that"),
    "indices more": (lambda m: m.update(indices=9), "a run ends with its last"),
    "indices beyond": (lambda m: m.update(indices=999_999_999), "too many to draw again"),
    "first draws": (lambda m: m.update(first_draws=1), "first_draws = 1"),
    "reasons": (lambda m: m.update(reasons={"robust: bad luck": 3}), "the reasons count 3"),
    "reasons of draws": (lambda m: m.update(reasons={"feasible: bad luck": 3}), "reasons of infeasible draws"),
    "keep": (lambda m: (m["config"].update(keep=["unknown"]), m.update(reasons={"robust: x": 1})), "rejects are kept"),
    "seed": (lambda m: m["config"].update(seed=1), "the seed is 0, the manifest says 1"),
    "sampler": (lambda m: m["config"].update(sampler="sobol"), DRAWN),
    "unknown split": (lambda m: m["config"].update(split="diagonol"), "did you mean 'diagonal'"),
    "range": (lambda m: m["config"]["task"]["id"].update(x=["uniform", 0.0, 0.01]), DRAWN),
    "category": (lambda m: m["config"]["task"].update(category="P1"), "the category is 'P1', that of the task"),
    "family": (lambda m: m["config"]["task"].update(family="scengen.tasks.packing.Packing"), "names the family"),
    "code that is run": (lambda m: m["config"]["task"].update(family="antigravity.fly"), "names the family"),
    "level": (lambda m: m["config"]["certify"].update(name="full"), "called full, whose bound"),
    "unknown level": (lambda m: m["config"]["certify"].update(name="strict"), "called 'strict'"),
    "more than was done": (lambda m: m["config"]["certify"]["robust"].update(runs=14), "check robust was made"),
    "rejects": (lambda m: m["funnel"].update(robust=5), "the funnel differs"),
    "subset": (lambda m: m.update(subset={"of": "0" * 64, "chosen": "by hand"}, n=5), "subset has a different number"),
}  # fmt: skip


@pytest.mark.parametrize("name", MANIFEST)
def test_a_false_claim_of_a_manifest_is_noticed(mine, name):
    change, says = MANIFEST[name]
    changed(mine, change)
    found = report(mine)
    assert not found.holds and any(re.search(says, f["reason"]) for f in found.failed), found.failed


def test_older_software_is_declined(mine):
    of = Pool.open(mine)
    older = {**of.manifest.versions, "mujoco": "3.3.0"}
    (mine / "scengen.lock").unlink()  # which tells of the other
    write_pool(mine, replace(of.manifest, versions=older), [certificate_of(r, versions=older) for r in of.rows()])
    found = report(mine)
    assert found.verdict == "declined" and "certified with mujoco 3.3.0" in found.failed[0]["reason"]


def test_a_pool_of_another_mujoco_is_judged_by_what_holds_here_on_request(mine):
    of = Pool.open(mine)
    older, stored = {**of.manifest.versions, "mujoco": "3.3.0"}, [*of.rows()]
    (mine / "scengen.lock").unlink()

    def judged(forge):
        rows = [certificate_of(forge(row), versions=older) for row in stored]
        write_pool(mine, replace(of.manifest, versions=older), rows)
        return report(mine, any_mujoco=True, sample=None)

    found = judged(certificate_with(final_state="0" * 32))
    assert (found.verdict, found.sound, found.drifted) == ("sound", len(of), len(of))
    assert any("certified with mujoco 3.3.0, this is" in remark for remark in found.remarks)
    for attribute in ("o_margin", "ls_iterations", "noslip_iterations"):
        found = judged(scene("<option ", f'<option {attribute}="3" '))
        assert (found.verdict, found.declined) == ("declined", len(of)), "a scene with other physics is never sound"
        assert f"{attribute} of <option>" in found.failed[0]["reason"]
    found = judged(scene("<geom name=", '<geom solmix="100" name='))
    assert (found.verdict, found.declined) == ("declined", len(of)) and "solmix of" in found.failed[0]["reason"]
    found = judged(witness(lambda actions: actions * 0))
    assert (found.verdict, found.declined) == ("declined", len(of))
    assert "certified with mujoco 3.3.0" in found.failed[0]["reason"] and "witness fails" in found.failed[0]["reason"]
    found = judged(witness(beyond))
    assert (found.verdict, found.refuted) == ("refuted", len(of)), (
        "what needs no simulation is a fault under any MuJoCo"
    )


def test_rows_in_another_order_or_twice_are_noticed(mine):
    of = Pool.open(mine)
    made = list(of.rows())
    write_pool(mine, of.manifest.without_files(), [*made[1:], made[0]])
    assert any("occurs twice, or after a later one" in f["reason"] for f in report(mine).failed)
    write_pool(mine, of.manifest.without_files(), [made[0], made[0], *made[2:]])
    assert any("the id occurs twice" in f["reason"] for f in report(mine).failed)


def test_a_family_of_a_manifest_is_never_imported(mine, tmp_path, monkeypatch):
    (tmp_path / "evilmod.py").write_text(f"open({str(tmp_path / 'HACKED')!r}, 'w')\nclass Evil: pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    changed(mine, lambda m: m["config"]["task"].update(family="evilmod.Evil"))
    from scengen.ood.analysis.redraw import task_of

    assert not report(mine).holds
    with pytest.raises(PoolError, match=r"names the family 'evilmod.Evil'"):
        task_of(Pool.open(mine))
    assert not (tmp_path / "HACKED").exists()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda m: m["config"]["task"].update(name="../evil"), "config.task.name"),
        (lambda m: m["config"]["task"].update(horizon=float("nan")), "not finite"),
        (lambda m: m["config"]["task"].update(horizon=1e300), "horizon"),
        (lambda m: m["config"]["certify"].update(settle=1e7), "settling time"),
        (lambda m: m["shards"][0].update(file="../../etc/passwd"), "outside the pool"),
        (lambda m: m["shards"].append(m["shards"][0]), "listed twice"),
        (lambda m: m.update(more=1), "no key named 'more'; known: attack, config,"),
        (lambda m: m.update(indices=-1), "indices = -1"),
        (lambda m: m["config"].update(sampler="lhs:1000000000"), "config.sampler"),
        (lambda m: m["config"]["task"]["axes"]["diagonal"].update(severities=10**9), "severities"),
    ],
)
def test_a_manifest_of_another_form_is_refused(mine, change, says):
    changed(mine, change)
    with pytest.raises(PoolError, match=says) as error:
        Pool.open(mine)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "text", ["[" * 200_000, '{"format": 4, "a": ' + "[" * 500 + "]" * 500 + "}", '{"format": 4, "format": 4}']
)
def test_a_manifest_with_deep_or_double_entries_is_refused(mine, text):
    (mine / "manifest.json").write_text(text)
    with pytest.raises(PoolError, match="is damaged"):
        Pool.open(mine)


def test_a_pipe_or_a_link_is_no_shard(mine):
    shard = mine / "scenarios-00000.parquet"
    moved = shard.rename(mine / "elsewhere")
    shard.symlink_to(moved)
    with pytest.raises(PoolError, match="is not a plain file"):
        list(Pool.open(mine).rows())
    shard.unlink()
    os.mkfifo(shard)
    assert Pool.open(mine).damaged() == {shard.name: "is not a plain file"}
    with pytest.raises(PoolError, match="is not a plain file"):
        list(Pool.open(mine).columns("id"))


def _written_over(pool, other):
    (pool / SHARD).write_bytes((other / SHARD).read_bytes())


def _replaced(pool, other):
    os.replace(shutil.copy(other / SHARD, pool / "part"), pool / SHARD)


def _other_folder(pool, other):
    """The pool is a link to a folder, and the link is changed. The files keep all their times."""
    pool.unlink()
    pool.symlink_to(other)


@pytest.mark.parametrize("back", [False, True], ids=["left", "restored"])
@pytest.mark.parametrize("swap", [_written_over, _replaced, _other_folder])
def test_files_are_not_changed_between_their_hashes_and_their_reading(mine, tmp_path, monkeypatch, swap, back):
    """A false pool has right hashes. While it is verified, a sound one stands in its place."""
    false = Path(shutil.copytree(mine, tmp_path / "false"))
    of = Pool.open(false)
    write_pool(false, of.manifest.without_files(), [replace(row, instruction="Rest.") for row in of.rows()])
    aside = Path(shutil.copytree(false, tmp_path / "aside"))
    pool = tmp_path / "pool"
    pool.symlink_to(false)
    assert report(pool).verdict == "refuted"
    damaged, count = Pool.damaged, _Run.count

    def hashed(of):
        found = damaged(of)
        if not of.folder.with_name("swapped").exists():
            of.folder.with_name("swapped").touch()
            swap(pool, mine)
        return found

    def counted(run):
        count(run)
        if back:
            swap(pool, aside)

    monkeypatch.setattr(Pool, "damaged", hashed)
    monkeypatch.setattr(_Run, "count", counted)
    found = report(pool)
    assert found.verdict == "refuted" and "changed since its sha256 was compared" in found.failed[0]["reason"]


def test_a_manifest_is_not_changed_during_verification(mine, monkeypatch):
    monkeypatch.setattr(_Run, "count", lambda run: changed(mine, lambda m: m.update(n=7)))
    found = report(mine)
    assert found.verdict == "refuted"
    assert found.failed == [
        {"id": "manifest.json", "verdict": "refuted", "reason": "it has been changed during verification"}
    ]


def test_a_shard_that_changes_after_all_was_read_is_noticed(mine, monkeypatch):
    monkeypatch.setattr(_Run, "count", lambda run: (mine / SHARD).write_bytes(b"PAR1"))
    found = report(mine)
    assert found.verdict == "refuted" and found.failed[0]["reason"].startswith("at the end of verification, the shard")


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"id": "../../../evil"}, "id '../../../evil' does not match"),
        ({"task": "../../evil"}, "task '../../evil'"),
        ({"horizon": float("inf")}, "horizon is not a finite number"),
        ({"horizon": 1e4}, "horizon = 10000 s"),
        ({"index": -1}, "index = -1"),
        ({"embodiment": "panda"}, "is not a robot"),
        ({"params": {"count": float("nan")}}, "not finite"),
        ({"params": {"count": "three"}}, "no number for 'count'"),
        ({"witness": np.full((3, 7), np.nan)}, "not finite"),
        ({"scene_sha256": "0"}, "scene_sha256"),
    ],
)
def test_a_row_of_another_form_is_refused_wherever_it_is_read(mine, columns, says):
    of = Pool.open(mine)
    write_pool(mine, of.manifest.without_files(), [replace(row, **columns) for row in of.rows()])
    with pytest.raises(PoolError, match=re.escape(says)) as error:
        list(Pool.open(mine).rows())
    assert "\n" not in str(error.value) and not report(mine).holds


# --- what is told -----------------------------------------------------------------------------------


def test_a_changed_task_is_told_key_by_key(mine):
    changed(mine, lambda m: m["config"]["task"].update(horizon=9.0, limits={}))
    told = {d["key"]: (d["pool"], d["installed"]) for d in report(mine).differences}
    assert told["horizon"] == ("9.0", "12.0")


def test_what_a_pool_says_of_its_task_is_shown_and_not_obeyed(mine, capsys):
    changed(mine, lambda m: m["config"]["task"]["axes"]["diagonal"].update(why="[/] \x1b[2J", source="\u202e"))
    assert cli.run(["verify", f"pool={mine}", "level=replay"]) == 0
    shown = capsys.readouterr().out
    assert "differs from the installed" in shown and "[/] \\x1b[2J" in shown and "\\u202e" in shown
    assert not set(shown) & set("\x1b\u202e")


def test_a_run_that_ended_with_fewer_than_were_asked_for_is_told(mine):
    assert not report(mine).remarks
    changed(mine, lambda m: m.update(n=60))
    found = report(mine)
    assert found.holds and found.remarks == [
        "60 scenarios were requested, and the run ended with 6: this number is the author's word"
    ]


def test_letters_that_look_alike_are_told_apart(mine, capsys):
    changed(
        mine,
        lambda m: m["config"]["task"].update(instruction=m["config"]["task"]["instruction"].replace("o", "\u043e")),
    )
    (difference,) = report(mine).differences
    assert difference["key"] == "instruction" and "\\u043e" in difference["pool"] and difference["installed"].isascii()


def test_own_settings_are_told(mine):
    changed(mine, lambda m: m["config"]["certify"]["rest"].update(seconds=1.0))
    assert report(mine).settings == "own settings (quick, except for rest.seconds)"


def test_what_takes_too_long_is_declined_and_the_others_are_not():
    found = verify(opened("single"), task("domino_single"), compose.certify_levels(task("domino_single")),
                   Options("full", sample=1, limits=Limits(0.5, 4000)))  # fmt: skip
    assert (found.verdict, found.declined, found.sound) == ("declined", 1, 5)
    assert "took longer than 0.5 s" in found.failed[0]["reason"]


def test_a_sample_simulates_few_and_looks_at_all():
    found = report(REFERENCE, sample=2, seed=7)
    assert (found.checked, found.rebuilt, found.replayed, found.sound) == (6, 6, 2, 6)
    assert found.sample == {"size": 2, "of": 6, "seed": 7, "excluded_share": 5 / 6}


def test_the_excluded_share_is_the_least_that_a_sample_meets():
    assert excluded_share(1_000_000, 300) == pytest.approx(0.00993, abs=1e-4)
    assert excluded_share(10, 10) == 0.1
    assert possible_false(5, 1) == 4 and bound(5, 1, "rows") == "at most 80 % of the rows can be bad (95 % confidence)"
    rng = np.random.default_rng(1)
    share = excluded_share(200, 30)
    false = np.arange(200) < round(share * 200)
    met = [false[rng.choice(200, 30, replace=False)].any() for _ in range(4000)]
    assert np.mean(met) == pytest.approx(0.95, abs=0.02) and np.mean(met) >= 0.94


def test_junit_tells_every_scenario_and_survives_any_text(mine):
    changed(mine, lambda m: m["funnel"].update(certified=40))
    found = report(mine)
    found.failed[0]["reason"] += "\x1b]0;<&\x00"
    suite = ET.fromstring(junit({"a\x07b": found}, found.level).encode()).find("testsuite")
    assert suite.attrib["tests"] == "7" and suite.attrib["failures"] == "1"
    assert len(suite.findall("testcase")) == 7
    told = {each.attrib["name"]: each.attrib["value"] for each in suite.findall("properties/property")}
    assert told["level"] == found.level and told["settings"] == found.settings and told["mujoco"] == mujoco.__version__


def test_canonical_numbers_survive_the_way_through_a_pool():
    """What is compared as text must be equal after writing and reading."""
    for check_ in rows("single")[0].certificate.checks:
        assert as_json(json.loads(as_json(check_.numbers))) == as_json(check_.numbers)
