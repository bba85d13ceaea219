"""The drift matrix: verdicts of a pool under several versions of MuJoCo, each in a separate environment."""

import json
import venv
from dataclasses import asdict, replace

import mujoco
import numpy as np
import pytest
import tables as generated
from pools import make

from scengen import cli, list_tasks, load_task
from scengen.certificate import CHECKS
from scengen.cli.commands import bench
from scengen.cli.commands import verify_mujoco as drift
from scengen.drift import environment as environments
from scengen.drift.environment import Environment, environment
from scengen.drift.judge import Judge, judge
from scengen.drift.matrix import cell, flips, matrix, remarks, tables, under
from scengen.drift.tracks import in_words, parted, track
from scengen.errors import BadConfig, ScengenError
from scengen.evidence import ledger
from scengen.pool.files import sha256
from scengen.validate.verify.recheck import BEFORE_WITNESS, WITH_WITNESS
from scengen.validate.verify.stored import settings_of_manifest
from scengen.work.fingerprint import fingerprint
from scengen.work.parallel import Limits

HERE = mujoco.__version__
LIMITS = Limits(300.0, 4000)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two scenarios, certified by the code and the MuJoCo that run here."""
    return make(tmp_path_factory.mktemp("drift") / "pool", n=2).pool


@pytest.fixture(scope="module")
def same(made):
    """Every check under the MuJoCo that made the pool: the control."""
    return [asdict(one) for one in judge(str(made.folder), (), "recheck", None, 1, LIMITS)]


@pytest.fixture(scope="module")
def changed(made):
    """The same checks with a bar that nothing passes, and of the second scenario a witness that stops halfway: what
    another MuJoCo does to some scenarios, these do to two."""
    task, settings = load_task(made.task), settings_of_manifest(made.manifest)
    strict = Judge(task, replace(settings, rest=replace(settings.rest, drift=0.0)), "recheck")
    first, second = made.rows()
    half = second.witness[: len(second.witness) // 4]
    halved = {"witness_sha256": sha256(half.tobytes())}
    short = replace(second, witness=half, certificate=replace(second.certificate, **halved), **halved)
    return [asdict(strict(first)), asdict(Judge(task, settings, "recheck")(short))]


@pytest.fixture(scope="module")
def result(made, same, changed):
    found = {
        version: {"fingerprint": told, "judged": {str(made.folder): judged}}
        for version, told, judged in ((HERE, fingerprint(), same), ("3.0.0", "otherwise", changed))
    }
    return json.loads(json.dumps(matrix([made], found, "recheck", None)))


def test_the_control_repeats_every_bit(made, same):
    assert [one["id"] for one in same] == [name.id for name in made.names()]
    for one, row in zip(same, made.rows(), strict=True):
        assert one["same_bits"] and not one["unknown"] and not one["scene"]
        assert one["final_state"] == row.certificate.final_state
        assert [check["name"] for check in one["checks"]] == [*BEFORE_WITNESS, "witness", *WITH_WITNESS]
        assert not any(check["flipped"] for check in one["checks"])
        assert all(c["numbers"] == c["stored"] for c in one["checks"] if c["name"] != "witness")


def test_the_matrix_counts_outcomes_and_flipped_checks(result):
    row = result["tasks"]["domino_single"]
    assert cell(row[HERE]) == "2 / 0 / 0" == cell(under(result, HERE))
    assert cell(row["3.0.0"]) == "0 / 0 / 2 (rest 1, witness 1)" == cell(under(result, "3.0.0"))
    assert [one["mujoco"]["3.0.0"]["outcome"] for one in result["scenarios"]] == ["flipped", "flipped"]


def test_a_flipped_check_stands_with_its_margins(made, result):
    first, second = made.rows()
    rest, witness = flips(result)
    assert rest[:3] == ("3.0.0", str(first.name), "rest")
    assert "mm while nobody acts" in rest[3] and "bar drift 0" in rest[3]
    assert witness[1:3] == (str(second.name), "witness") and "the goal was not reached" in witness[3]
    assert "1 of 1 jittered runs, goal after" in witness[5]


def test_where_the_recording_fails_the_oracle_is_asked(changed):
    _, second = changed
    made = {check["name"]: check["passed"] for check in second["checks"]}
    assert made["witness"] is False and made["solved"] is True
    assert not made.keys() & set(WITH_WITNESS), "nothing is played that has no witness"


def test_the_control_is_named_where_it_is_missing(made, same, changed, result):
    assert not list(remarks(result))
    alone = matrix([made], {"3.0.0": {"fingerprint": "", "judged": {str(made.folder): changed}}}, "recheck", None)
    (told,) = remarks(alone)
    assert f"made with mujoco {HERE}" in told and "control" in told
    elsewhere = matrix([made], {HERE: {"fingerprint": "other", "judged": {str(made.folder): same}}}, "recheck", None)
    (told,) = remarks(elsewhere)
    assert "rounds differently" in told


def test_a_row_that_is_none_is_unknown_and_no_flip(made):
    task, settings = load_task(made.task), settings_of_manifest(made.manifest)
    row = next(made.rows())
    other = replace(row, witness=np.zeros_like(row.witness))
    found = asdict(Judge(task, settings, "recheck")(other))
    assert "the witness has a different sha256" in found["unknown"] and not found["checks"]


def test_level_full_makes_every_check_but_one_that_was_not_asked_for(made):
    task, settings = load_task(made.task), settings_of_manifest(made.manifest)
    found = Judge(task, settings, "full")(next(made.rows()))
    assert {check.name for check in found.checks} == set(CHECKS) - {"attack"}
    assert found.same_bits and not any(check.flipped for check in found.checks)


@pytest.fixture(scope="module")
def here(tmp_path_factory):
    """An environment as drift makes them, but for the download: its MuJoCo is the one that is installed."""
    folder = tmp_path_factory.mktemp("environment") / "same"
    venv.EnvBuilder(symlinks=True, with_pip=False).create(folder)
    (packages,) = (folder / "lib").glob("python*/site-packages")
    (packages / environments.SHARED).write_text(environments._shared())
    return Environment(HERE, folder)


@pytest.mark.slow
def test_an_environment_shares_everything_but_mujoco(made, here, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(drift, "environment", lambda version, told: here)
    report = tmp_path / "drift.json"
    given = ("verify", "mujoco", f"pool={made.folder}", f"mujoco={HERE}", "n=1", "level=replay", f"json={report}")
    assert cli.run(given) == 0
    assert "1 / 0 / 0" in capsys.readouterr().out
    told = json.loads(report.read_text())
    assert told["mujoco"] == {HERE: {"fingerprint": fingerprint()}} and len(told["scenarios"]) == 1


@pytest.mark.slow
def test_an_environment_with_a_mujoco_that_it_should_not_have_is_refused(made, here, monkeypatch, capsys):
    monkeypatch.setattr(drift, "environment", lambda version, told: replace(here, mujoco=version))
    assert cli.run(("verify", "mujoco", f"pool={made.folder}", "mujoco=[3.4.0]", "level=replay")) == 2
    assert f"the environment of mujoco 3.4.0 imports {HERE}" in capsys.readouterr().err


@pytest.mark.slow
def test_what_fails_in_an_environment_is_one_line(here):
    with pytest.raises(ScengenError, match=f"under mujoco {HERE}: no pool at nowhere"):
        limits = {"limit_seconds": 300, "limit_mb": 4000}
        asked = {"pools": ["nowhere"], "search": [], "level": "replay", "n": None, "workers": 1, **limits}
        list(here.lines("scengen.drift.judge", asked))
    with pytest.raises(ScengenError, match="No module named"):
        list(here.lines("scengen.drift.nothing", {}))


@pytest.mark.parametrize("version", ["3.5", "latest", "3.4.0 --index-url=x", "../3.4.0", ">=3.4.0"])
def test_a_version_is_spelled_whole(version):
    with pytest.raises(BadConfig, match="give whole versions"):
        environment(version)


@pytest.mark.slow
def test_a_version_that_does_not_exist_is_told_with_those_that_do():
    said = (
        "ERROR: Could not find a version that satisfies the requirement mujoco==3.4.9 (from versions: 3.3.7, 3.4.0)\n"
    )
    told = environments._why_not("3.4.9", said)
    assert told == "there is no mujoco 3.4.9 for this Python (did you mean '3.4.0'?); the newest are 3.3.7, 3.4.0"
    assert "pip cannot install mujoco 3.4.0: ERROR: no network" in environments._why_not("3.4.0", "ERROR: no network")


def test_tables_are_printed(result, capsys):
    for table in tables(result):
        drift.out.print(table)
    assert "0 / 0 / 2 (rest 1, witness 1)" in capsys.readouterr().out


def test_the_page_is_made_of_its_results_and_the_control_repeats_every_bit():
    assert "| **all** |" in generated.drift()["drift"]
    values = [row.value for task in list_tasks() for row in ledger.newest("drift", task)]
    ends = {one["mujoco"][value["control"]]["outcome"] for value in values for one in value["scenarios"]}
    assert ends == {"same bits"}


@pytest.mark.slow
def test_another_mujoco_is_really_another_one(made, tmp_path, monkeypatch, capsys):
    """An environment from the package index: the bits of both scenarios are others, their verdicts are not."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    report = tmp_path / "drift.json"
    assert cli.run(("verify", "mujoco", f"pool={made.folder}", "mujoco=[3.4.0]", f"json={report}")) == 0
    told = json.loads(report.read_text())
    assert cell(told["tasks"]["domino_single"]["3.4.0"]) == "0 / 2 / 0"
    assert "as the control" in capsys.readouterr().err
    assert cli.run(("verify", "mujoco", f"pool={made.folder}", "mujoco=[3.4.99]")) == 2
    assert "there is no mujoco 3.4.99 for this Python" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "scengen").glob("mujoco-*[!k]")] == [
        path.name for path in (tmp_path / "scengen").glob("mujoco-3.4.0-????????????")
    ], "nothing is left of what could not be made"


def test_a_witness_parts_from_its_course_when_a_body_is_elsewhere(made):
    task, row = load_task(made.task), next(made.rows())
    one, again = track(task, row), track(task, row)
    assert one == again and parted(one, again) == []
    assert in_words([]) == "no body is 0.1 mm elsewhere while the actions last"
    raised = json.loads(json.dumps(one))
    for sample in raised:
        if sample["at"] >= 0.5:
            for place, _ in sample["bodies"].values():
                place[2] += 2e-3
    small, large = parted(one, raised)
    assert (small["mm"], large["mm"]) == (0.1, 1.0) and small["seconds"] == large["seconds"] == 0.5
    assert "0.1 mm elsewhere after 0.5 s, touching" in in_words([small])


@pytest.mark.slow
def test_a_witness_that_flipped_is_followed_under_both_versions(here, result):
    """Both environments have the same MuJoCo here, so that no body parts."""
    again = json.loads(json.dumps(result))
    drift._add_partings(again, [here, replace(here, mujoco="3.0.0")], ())
    first, second = (one["mujoco"]["3.0.0"] for one in again["scenarios"])
    assert "parted" not in first and second["parted"] == []
    assert [line[4] for line in flips(again)] == ["", in_words([])]


@pytest.mark.slow
def test_costs_under_several_versions_are_measured_by_turns(here, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(bench, "environment", lambda version, told: replace(here, mujoco=version))
    told = tmp_path / "bench.json"
    assert cli.run(("bench", f"mujoco=[{HERE},3.0.0]", "repeats=2", f"json={told}")) == 0
    found = json.loads(told.read_text())
    assert list(found) == [HERE, "3.0.0"]
    assert all(len(values) == 2 and min(values) > 0.0 for measures in found.values() for values in measures.values())
    assert list(found[HERE]) == ["rollout_to_raw", "env_step_to_raw", "scenario_to_first_step_ms"]
    out = capsys.readouterr().out
    assert "3.0.0" in out and "at most 1.25" in out
    assert cli.run(("bench", f"mujoco=[{HERE}]", "certify=true")) == 2
    assert "leave out mujoco=" in capsys.readouterr().err
