"""Verification ends where the rest cannot matter, and counts what a run has left out."""

import json
import shutil
from dataclasses import replace

import pytest
from helpers import REFERENCE
from pools import certificate_of

from scengen import compose, load_task
from scengen.errors import ScengenError
from scengen.pool import Pool
from scengen.pool.files import sha256
from scengen.pool.writing import write_pool
from scengen.validate.playable import check_row, check_scene
from scengen.validate.verify import pools as verify
from scengen.validate.verify import survey
from scengen.validate.verify.survey import Reject
from scengen.work.parallel import Limits, WorkerDied


@pytest.fixture
def mine(tmp_path):
    """A copy of the reference pool that may be changed."""
    return shutil.copytree(REFERENCE, tmp_path / "pool")


def changed(folder, **entries):
    """Other entries in a manifest."""
    path = folder / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **entries}))


def report(folder, **options):
    of = Pool.open(folder)
    task = load_task(of.task)
    settings = {"level": "replay", "limits": None, "sample": 1, **options}
    return verify.verify(of, task, compose.certify_levels(task), verify.Options(**settings))


def faults(found):
    return [f["reason"] for f in found.failed]


def test_a_redraw_ends_where_more_comes_out_than_the_manifest_counts(mine, monkeypatch):
    funnel = {**Pool.open(mine).manifest.funnel, "proposed": 3}
    changed(mine, funnel=funnel)
    monkeypatch.setattr(survey, "CHUNK", 2)
    assert "the funnel counts 3 draws; 4 of its 6 indices alone give 4" in faults(report(mine))


def test_a_redraw_that_takes_too_long_is_declined(mine, monkeypatch):
    monkeypatch.setattr(survey, "patience", lambda of, seconds: -1.0)
    found = report(mine, limits=Limits(100.0, 4000))
    assert found.verdict == "declined" and "drawing its indices again takes longer" in faults(found)[0]


def test_many_draws_are_declined_for_few_scenarios(mine):
    of = Pool.open(mine)
    most = survey.MAX_DRAWS + survey.MAX_DRAWS_PER_ROW * len(of)
    for entries, what in (({"indices": most + 1}, "indices"), ({"funnel": {"proposed": most + 1}}, "draws")):
        assert survey.too_large(replace(of.manifest, **entries)).startswith(f"{most + 1} {what} for 6 scenarios")
    assert not survey.too_large(of.manifest)


def test_after_some_false_scenarios_the_others_are_not_looked_at(mine, monkeypatch):
    monkeypatch.setattr(verify, "MAX_FAULTS", 2)
    of = Pool.open(mine)
    write_pool(mine, of.manifest.without_files(), [replace(row, instruction="Do nothing.") for row in of.rows()])
    found = report(mine)
    assert found.checked == found.refuted == 2
    assert "2 scenarios are refuted; those after them were not looked at" in faults(found)


def test_more_rows_than_promised_are_not_read_to_their_end(mine):
    shards = json.loads((mine / "manifest.json").read_text())["shards"]
    changed(mine, shards=[{**shards[0], "rows": 2}])
    found = report(mine)
    assert found.checked == 2 and "holds more than 2 rows, and the manifest promises 2" in faults(found)[0]


# --- what a run has left out ------------------------------------------------------------------------

TOLD = {"robust: # of #": 2, "rest: tile_# drifts": 1, "feasible: too near": 7}


@pytest.mark.parametrize(
    ("again", "entries", "fine"),
    [
        (["robust: # of #", "robust: # of #", "rest: tile_# drifts"], {}, True),
        (["robust: # of #", "rest: tile_# drifts", "rest: tile_# drifts"], {}, False),
        (["robust: # of #", "robust: # of #", ""], {}, False),  # one of them is certified here
        (["robust: # of #", "robust: # of #", "rest: tile_# drifts", ""], {}, False),
        (["robust: # of #", "robust: # of #", "rest: tile_# drifts", ""], {"process: took longer": 1}, True),
        (["robust: # of #", "robust: # of #", "rest: tile_# drifts", ""], {"attack: a way around": 1}, False),
    ],
)
def test_what_was_left_out_fails_for_the_reasons_that_are_told(mine, again, entries, fine):
    of = Pool.open(mine)
    told = replace(of.manifest, reasons={**TOLD, **entries})
    assert (not list(survey.wrong_losses(told, dict(enumerate(again))))) == fine


def test_what_an_attack_on_the_finished_pool_has_refuted_may_be_certified(mine):
    of = Pool.open(mine)
    manifest = replace(of.manifest, attack={"rates": [], "hits": []}, reasons={"attack: a way around": 1})
    assert not list(survey.wrong_losses(manifest, {3: ""}))


def test_rejects_are_those_that_the_reasons_tell_of(mine):
    of = Pool.open(mine)
    kept_config = replace(of.manifest.config, keep=("unknown",))
    told = replace(of.manifest, config=kept_config, reasons={"robust: # of # runs": 2, "idle: it falls": 1})
    kept = [Reject(7, "robust: # of # runs"), Reject(9, "robust: # of # runs")]
    assert not list(survey.wrong_rejects(told, kept, {1: 0}))
    assert list(survey.wrong_rejects(told, kept[:1], {1: 0}))
    assert list(survey.wrong_rejects(told, [kept[0], Reject(9, "robust: bad luck")], {1: 0}))
    assert any("certified too" in why for why in survey.wrong_rejects(told, kept, {7: 0}))
    assert any("order" in why for why in survey.wrong_rejects(told, kept[::-1], {1: 0}))


# --- scenes that nobody should play -------------------------------------------------------------------


def test_a_scene_that_does_not_end_is_named_before_anybody_looks_at_it(monkeypatch):
    row = next(Pool.open(REFERENCE).rows())
    assert check_row(row) is row
    monkeypatch.setattr("scengen.validate.playable.UNTRUSTED_LIMITS", Limits(2.0, 4000))
    endless = row.scene_xml.replace("<option ", '<option iterations="1000000000" tolerance="0" ')
    assert endless != row.scene_xml
    with pytest.raises(WorkerDied, match=f"playing {row.name} took longer than 2 s"):
        check_row(replace(row, scene_xml=endless.replace('timestep="', 'timestep="0.0000')))
    with pytest.raises(ScengenError):
        check_scene("<mujoco><include file='/etc/passwd'/></mujoco>", row.embodiment)


def test_a_reject_needs_the_scene_that_belongs_to_it():
    from scengen.validate.verify.examine import Examiner
    from scengen.validate.verify.stored import settings_of_manifest, task_of_manifest

    of = Pool.open(REFERENCE)
    made = verify.Claims.of(of, task_of_manifest(of, load_task(of.task)), settings_of_manifest(of.manifest))
    config_ = replace(made.manifest.config, keep=("unknown",))
    claims = replace(made, manifest=replace(made.manifest, config=config_))
    row = next(of.rows())
    names = [check.name for check in row.certificate.checks]
    place = names.index("robust")
    checks = [
        check
        if k < place
        else replace(check, passed=False if k == place else None, reason="1 of 4" if k == place else "skipped")
        for k, check in enumerate(row.certificate.checks)
    ]
    kept = certificate_of(row, checks=tuple(checks), verdict="unknown", reason="robust: 1 of 4")
    examined = Examiner(claims, "replay", False)((kept, False, False))
    assert examined.reasons == ()
    nothing = sha256("")
    empty = certificate_of(replace(kept, scene_xml="", scene_sha256=nothing), scene_sha256=nothing)
    assert any(
        "the scene is not the one" in why for why in Examiner(claims, "replay", False)((empty, False, False)).reasons
    )
