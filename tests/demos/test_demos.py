"""Demonstrations are the same bytes however they were made, they replay bit for bit, and every forgery is found."""

import json
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import REFERENCE

from scengen import cli, load_task
from scengen.cli.commands.settings import read_task
from scengen.demos.generate import DemosSettings, Job, generate_demonstrations
from scengen.demos.styles import NOISE, NOISE_TIME, WEIGHTS, chosen, in_style, style_of
from scengen.demos.verify import verify_demonstrations
from scengen.errors import BadConfig, PoolError, UnknownName
from scengen.pool import Pool
from scengen.pool.demonstrations import DEMONSTRATIONS, FAILED, Demonstrations, write_demonstrations
from scengen.pool.files import sha256
from scengen.sim.world import World
from scengen.skills.pace import COARSE, CONTACT_DISTANCE, DISPLACED_TIME, STEADY, Manner
from scengen.validate.rebuilt import world_of
from scengen.validate.rollout import run
from scengen.work.parallel import Limits


def make(folder, *overrides, **changed):
    """Make a few demonstrations of `domino_single`."""
    given = [f"{name}={value}" for name, value in {"n": 4, "runs": 2, **changed, "to": folder}.items()]
    settings, task, checks = read_task("demos", ["task=domino_single", *given, *overrides], DemosSettings)
    return generate_demonstrations(task, checks, settings, lambda *_: None)


def verified(folder, **options):
    return verify_demonstrations(
        Demonstrations.open(folder), load_task("domino_single"), 1, Limits(300, 4000), **options
    )


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demos") / "made"
    make(folder)
    return folder


@pytest.fixture
def mine(made, tmp_path):
    """A copy to damage."""
    return Path(shutil.copytree(made, tmp_path / "mine"))


def forge(folder, change):
    """Change the rows of a folder, and write hashes to match."""
    found = Demonstrations.open(folder)
    rows = [change(row) or row for row in found.rows()]
    write_demonstrations(folder, found.manifest, rows, [])


# --- making them ------------------------------------------------------------------------------


def test_a_demonstration_says_its_scenario_its_run_its_style_and_its_result(made):
    rows = list(Demonstrations.open(made).rows())
    assert [(row.index, row.run) for row in rows] == [(0, 0), (0, 1), (1, 0), (1, 1)]
    for row in rows:
        assert row.outcome == "success" and not row.reason and row.seed == 1000
        assert row.style == chosen([*WEIGHTS], *row.key)
        assert 0 < row.seconds <= row.horizon and len(row.witness) == round(100 * (row.seconds + 1.0))


def test_runs_of_one_scenario_differ(made):
    one, other, *_ = Demonstrations.open(made).rows()
    assert one.id == other.id and one.witness_sha256 != other.witness_sha256


@pytest.mark.parametrize("workers", [1, 2])
def test_the_bytes_do_not_depend_on_workers_or_interruptions(made, tmp_path, workers):
    def stop(kept, *_):
        if kept == 2:
            raise KeyboardInterrupt

    folder = tmp_path / "again"
    given = ["task=domino_single", "n=4", "runs=2", f"to={folder}", f"workers={workers}"]
    settings, task, checks = read_task("demos", given, DemosSettings)
    with pytest.raises(KeyboardInterrupt):
        generate_demonstrations(task, checks, settings, stop)
    with pytest.raises(PoolError, match="a run was started there; repeat its command"):
        Demonstrations.open(folder)
    generate_demonstrations(task, checks, settings, lambda *_: None)
    for path in made.iterdir():
        assert (folder / path.name).read_bytes() == path.read_bytes()


def test_other_settings_do_not_continue_a_run(made):
    with pytest.raises(PoolError, match="was started with other settings .*seed.*; choose another to="):
        make(made, seed=7)


def test_the_scenarios_of_a_pool_are_kept_out_and_counted(made, tmp_path):
    reference = Pool.open(REFERENCE)
    summary = make(tmp_path / "demos", n=2, runs=1, seed=0, apart=REFERENCE)
    shared = {row.id for row in Demonstrations.open(tmp_path / "demos").rows()} & {
        id_ for (id_,) in reference.columns("id")
    }
    assert not shared and len(reference) and summary.manifest.reasons
    assert sum(n for why, n in summary.manifest.reasons.items() if why.startswith("apart: ")) == (
        summary.manifest.funnel["feasible"] - summary.manifest.funnel["apart"]
    )
    assert summary.manifest.config.apart == (reference.sha256,)


def test_failed_attempts_are_counted_and_kept_on_request(tmp_path):
    summary = make(tmp_path / "demos", "task.horizon=3.0", n=2, runs=1, keep="failed", limit=12)
    manifest, found = summary.manifest, Demonstrations.open(tmp_path / "demos")
    failures = list(found.failures())
    assert failures and all(row.outcome == "timeout" and row.reason for row in failures)
    assert manifest.outcomes["timeout"] == len(failures) == manifest.funnel["unsolved"] - manifest.funnel["solved"]
    assert verified(tmp_path / "demos").verdict == "sound"


def test_without_a_style_the_oracle_plays_the_witnesses_of_earlier_versions():
    task = load_task("domino_single")
    for row in list(Pool.open(REFERENCE).rows())[:2]:
        scenario = task.scenario(row.params)
        played = run(scenario, world_of(scenario), in_style(scenario.oracle, "nominal"), row.horizon)
        assert played.actions.tobytes() == row.witness.tobytes()
        assert played.digest == row.certificate.final_state


# --- styles -----------------------------------------------------------------------------------


def test_styles_have_their_shares():
    counts = Counter(chosen([*WEIGHTS], "task", str(k), 0) for k in range(2000))
    for style, weight in WEIGHTS.items():
        assert abs(counts[style] / 2000 - weight / 5) < 0.04
    assert {chosen(["recover"], "task", "id", k) for k in range(20)} == {"recover"}


def test_a_reset_removes_the_style():
    scenario = load_task("domino_single").nominal
    world = world_of(scenario)
    next(in_style(scenario.oracle, "varied", "key")(world))
    assert world.style is not None
    world.reset()
    assert world.style is None


def test_the_noise_of_a_free_arm_is_correlated_and_has_its_size():
    world = world_of(load_task("domino_single").nominal)

    def still(world):
        while True:
            yield np.zeros(7)

    plan = in_style(still, "varied", "key")(world)
    noise = np.array([next(plan) for _ in range(4000)])[:, :6]
    lag = round(100 * NOISE_TIME)
    correlation = np.mean(noise[:-lag] * noise[lag:]) / np.mean(noise**2)
    assert noise.std() == pytest.approx(NOISE, rel=0.15) and correlation == pytest.approx(np.exp(-1), abs=0.1)
    assert np.all(np.array([next(plan) for _ in range(10)])[:, 6] == 0), "the gripper has no noise"


def manner(style, pace, way):
    world: World = world_of(load_task("domino_single").nominal)
    world.style = style_of(style, "key")
    return Manner.of(world.arm, world.arm.hand + np.array(way), pace)


def test_a_detour_keeps_away_from_the_ends_of_a_move_and_never_goes_down():
    found = manner("varied", COARSE, [0.3, 0.0, 0.0])
    inside = np.linspace(CONTACT_DISTANCE, found.length - CONTACT_DISTANCE, 50)[1:-1]
    assert all(np.linalg.norm(found.detour_at(left)) > 0 and found.detour_at(left)[2] >= 0 for left in inside)
    for left in (0.0, CONTACT_DISTANCE, found.length - CONTACT_DISTANCE, found.length):
        assert np.allclose(found.detour_at(left), 0.0, atol=1e-12)


def test_only_a_recovery_displaces_the_command_and_only_for_its_time():
    found, step = manner("recover", COARSE, [0.3, 0.0, 0.0]), 1e-4
    displaced = [left for left in np.arange(0.0, found.length, step) if found.displacement_at(left).any()]
    assert len(displaced) * step / found.pace.speed == pytest.approx(DISPLACED_TIME, rel=0.01)
    assert np.linalg.norm(found.displacement_at(found.length / 2)) == pytest.approx(0.015)
    assert not manner("varied", COARSE, [0.3, 0.0, 0.0]).displacement_at(0.15).any()


def test_moves_beside_objects_and_certificates_are_straight_and_begin_at_once():
    for found in (manner("varied", STEADY, [0.3, 0.0, 0.0]), manner("nominal", COARSE, [0.3, 0.0, 0.0])):
        assert not found.pause and not found.detour_at(0.15).any() and not found.displacement_at(0.15).any()
    assert manner("nominal", COARSE, [0.3, 0.0, 0.0]).pace == COARSE


# --- verification -----------------------------------------------------------------------------


def test_all_of_them_replay_bit_for_bit_and_the_oracle_plays_them_again(made, capsys):
    report = verified(made, oracle=True)
    assert report.verdict == "sound" and report.exact == report.checked == 4
    assert cli.run(["verify", f"pool={made}", "level=full"]) == 0
    assert "sound: 4 of 4 replay bit for bit" in capsys.readouterr().out


def shifted(row):
    witness = row.witness.copy()
    witness[20] = witness[21]
    return replace(row, witness=witness, witness_sha256=sha256(witness.tobytes()))


FORGERIES = {
    "a different sha256": lambda row: replace(row, witness=shifted(row).witness),
    "other bits": shifted,
    "filter cannot give": lambda row: replace(row, witness=np.sign(row.witness).astype(np.float32)),
    "the style is": lambda row: replace(row, style="recover" if row.style == "varied" else "varied"),
    "takes": lambda row: replace(row, seconds=row.seconds - 0.01),
    "failed attempt among": lambda row: replace(row, outcome="timeout"),
    "occurs twice": lambda row: replace(row, index=0, run=0),
    "none of the 4 attempts": lambda row: replace(row, run=3),
    "the horizon is": lambda row: replace(row, horizon=99.0),
    "not the one that the family builds": lambda row: replace(
        row, scene_xml=row.scene_xml + " ", scene_sha256=sha256(row.scene_xml + " ")
    ),
    "the id does not belong": lambda row: replace(row, id="0" * 12),
}


@pytest.mark.parametrize("says", FORGERIES)
def test_a_forged_row_is_refuted(mine, says):
    forge(mine, FORGERIES[says])
    report = verified(mine)
    assert report.verdict == "refuted" and any(says in fault for fault in report.faults), report.faults


def test_a_damaged_file_and_false_counts_are_refuted(mine):
    path = mine / DEMONSTRATIONS
    plain = json.loads(path.read_text())
    plain["styles"] = {"varied": 4}
    path.write_text(json.dumps(plain))
    assert any("counts other styles" in fault for fault in verified(mine).faults)
    (file,) = mine.glob("*.parquet")
    file.write_bytes(file.read_bytes()[:-1])
    assert any("truncated" in fault for fault in verified(mine).faults)
    path.write_text("{}")
    with pytest.raises(PoolError, match="is damaged; restore it"):
        Demonstrations.open(mine)


def test_pools_and_demonstrations_are_verified_separately(made, capsys):
    assert cli.run(["verify", f"pool={made},{REFERENCE}"]) == 2
    assert "verify pools and demonstrations separately" in capsys.readouterr().err
    assert cli.run(["verify", f"pool={made}", "sample=2"]) == 2
    assert "demonstrations are all replayed" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changed", "error", "says"),
    [
        ({"styles": "[shaky]"}, UnknownName, "no style named 'shaky'; known: nominal, recover, varied"),
        ({"styles": "[]"}, BadConfig, "give at least one style"),
        ({"keep": "all"}, BadConfig, "it must be failed, or be left out"),
        ({"runs": 0}, BadConfig, "runs = 0; it must be at least 1"),
        ({"split": "nowhere"}, UnknownName, "no split of domino_single named 'nowhere'"),
    ],
)
def test_settings_without_a_meaning_are_refused(tmp_path, changed, error, says):
    with pytest.raises(error, match=says.replace("[", r"\[")):
        make(tmp_path / "demos", **changed)
    assert not list(tmp_path.iterdir())


def test_several_tasks_are_written_below_one_folder(tmp_path, capsys):
    assert cli.run(["demos", "task=domino_single,mirror_pick_place", "n=1", f"to={tmp_path / 'all'}"]) == 0
    assert cli.run(["verify", f"pool={tmp_path / 'all'}"]) == 0
    assert capsys.readouterr().out.count("sound: 1 of 1 replay bit for bit") == 2
    assert not (tmp_path / "all" / FAILED).exists()


def test_a_scenario_that_crashes_its_worker_is_a_failed_attempt(made):
    config = Demonstrations.open(made).manifest.config
    job = Job(load_task("domino_single"), config, None, None)  # type: ignore[arg-type]
    record = job.lost_record(3, "died")
    assert (record.verdict, record.check, record.reason) == ("failed", "process", "died")
