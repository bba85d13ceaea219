"""A pool is the same bytes however it was made, and every damage to it is found."""

import ast
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pools import QUICKLY, certificate_of, make, rewritten

from scengen import load_task
from scengen.certificate import StoredCertificate
from scengen.errors import PoolError, UnknownName
from scengen.pool import Pool, PoolRow
from scengen.pool.files import sha256
from scengen.pool.manifest import FORMAT
from scengen.pool.row import SCHEMAS
from scengen.pool.writing import write_pool
from scengen.tasks.domino_single import DominoSingle
from scengen.validate.settings import CertifySettings
from scengen.validate.verify.pools import Options, verify

ROOT = Path(__file__).parents[2]


def examined(folder, workers=1, level="replay"):
    options = Options(level, workers=workers, limits=None)
    return verify(Pool.open(folder), load_task("domino_single"), {"quick": CertifySettings()}, options)


def failures(folder, workers=1):
    return examined(folder, workers).failed


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pools") / "made"
    make(folder)
    return folder


@pytest.fixture
def mine(made, tmp_path):
    """A copy to damage."""
    return Path(shutil.copytree(made, tmp_path / "mine"))


# --- reading --------------------------------------------------------------------------------


def test_a_pool_holds_the_first_certified_indices_in_order(made):
    with pytest.raises(PoolError, match=f"did you mean '{made}'"):
        Pool.open(made.parent)
    rows = list(Pool.open(made))
    assert [r.index for r in rows] == [0, 1, 2]
    assert all(r.certificate.complete and r.split == "id" and r.axes == () and r.shifted == {} for r in rows)
    assert all(repr(r.certificate).startswith("StoredCertificate(certified: ") for r in rows)
    assert all(r.witness.dtype == np.float32 and r.witness.shape[1] == 7 for r in rows)


def test_a_row_has_a_field_for_every_column():
    assert [f.name for f in fields(PoolRow)] == SCHEMAS[7].names
    certificate = SCHEMAS[7].field("certificate").type
    assert [f.name for f in fields(StoredCertificate)] == [f.name for f in certificate]


def test_rows_are_values_that_cannot_be_changed_and_come_back_from_plain_data(made):
    row = next(Pool.open(made).rows())
    with pytest.raises(AttributeError):
        row.task = "other"
    again = PoolRow.of(row.plain(), row.witness)
    assert again == row and again.plain() == row.plain() and replace(row, index=9) != row


def test_light_reading_gives_the_same_values(made):
    opened = Pool.open(made)
    rows = list(opened.rows())
    assert list(opened.columns("id", "params")) == [(r.id, r.params) for r in rows]
    assert list(opened.rows(witness=False)) == rows and all(len(r.witness) == 0 for r in opened.rows(witness=False))
    with pytest.raises(UnknownName, match="did you mean 'witness_sha256'"):
        next(opened.columns("witness"))


def test_the_manifest_is_read_by_names(made):
    opened = Pool.open(made)
    manifest, config = opened.manifest, opened.manifest.config
    assert (opened.task, opened.split, config.sampler, config.seed) == ("domino_single", "id", "iid", 0)
    assert (manifest.settings, manifest.indices, manifest.is_subset) == ("quick", 3, False)
    assert manifest.funnel["certified"] == 3 and manifest.reasons == {} and manifest.versions["mujoco"]
    assert manifest.task_node == load_task("domino_single").node


def test_plain_pyarrow_reads_it(made):
    table = pq.read_table(made / "scenarios-00000.parquet")
    assert table.num_rows == 3 and len(table["witness"][0].as_py()[0]) == 7


def test_nothing_in_a_pool_names_the_machine_or_the_time(made):
    text = (made / "manifest.json").read_text() + "".join(str(r.plain()) for r in Pool.open(made).rows())
    assert str(made.parent) not in text and os.uname().nodename not in text.split() and str(Path.home()) not in text


def test_the_instruction_names_neither_axis_nor_values(made):
    task = load_task("domino_single")
    for axis in task.axes:
        assert axis not in task.instruction and axis.replace("_", " ") not in task.instruction


def test_a_scenario_is_found_by_the_beginning_of_its_id(made):
    opened = Pool.open(made)
    first = next(opened.rows())
    assert opened.row(first.id[:6]).index == 0
    with pytest.raises(UnknownName, match="no scenario in"):
        opened.row("zzz")


# --- the same bytes -----------------------------------------------------------------------------


@pytest.mark.slow
def test_two_workers_write_the_bytes_of_one(made, tmp_path):
    assert make(tmp_path / "two", workers=2).pool.sha256 == Pool.open(made).sha256


@pytest.mark.slow
def test_a_pool_can_be_extended_and_comes_out_as_if_made_at_once(mine, made, tmp_path):
    shutil.copytree(made.with_name("made.run"), mine.with_name("mine.run"))
    assert make(mine, n=4).pool.sha256 == make(tmp_path / "four", n=4).pool.sha256


@pytest.mark.slow
def test_killed_and_continued_is_the_same_as_never_killed(made, tmp_path):
    """SIGKILL in the middle of a run with two workers; nothing survives it, not even the workers."""
    folder = tmp_path / "killed"
    command = [sys.executable, "-m", "scengen", "generate", "task=domino_single", "n=3", "workers=2", *QUICKLY]
    process = subprocess.Popen([*command, f"pool={folder}"], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    wal = folder.with_name("killed.run") / "journal.sqlite-wal"
    while process.poll() is None and not (wal.exists() and wal.stat().st_size > 40_000):
        time.sleep(0.02)
    assert process.poll() is None, "the run must be under way when it is killed"
    children = children_of(process.pid)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not (folder / "manifest.json").exists()
    deadline = time.monotonic() + 10
    while any(alive(child) for child in children):
        assert time.monotonic() < deadline, "a worker outlived its parent"
        time.sleep(0.05)
    done = subprocess.run([*command, f"pool={folder}"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert Pool.open(folder).sha256 == Pool.open(made).sha256


def children_of(pid):
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and (parts := stat_of(int(entry.name))) and int(parts[1]) == pid:
            found.append(int(entry.name))
    return found


def alive(pid):
    parts = stat_of(pid)
    return bool(parts) and parts[0] != "Z"


def stat_of(pid):
    """State and parent of a process, or nothing."""
    try:
        return (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[:2]
    except OSError:
        return []


def test_a_second_run_on_the_same_pool_is_refused(tmp_path):
    from scengen.runs.journal import Journal

    first = Journal(tmp_path / "pool", {"a": 1})
    with pytest.raises(PoolError, match="another run is writing"):
        Journal(tmp_path / "pool", {"a": 1})
    first.close()
    Journal(tmp_path / "pool", {"a": 1}).close()


def test_other_settings_cannot_continue_a_run(made):
    with pytest.raises(PoolError, match=r"other settings \(config.seed\)"):
        make(made, seed=1)
    with pytest.raises(PoolError, match=r"config.task.id.gap_ratio"):
        make(made, "task.id.gap_ratio=[uniform,0.7,1.0]")


def test_a_run_of_one_spelling_of_a_split_is_continued_by_another(tmp_path):
    first = make(tmp_path / "pool", split="wide_gaps@1", n=1).pool
    again = make(tmp_path / "pool", split="wide_gaps@01", n=1).pool
    assert first.split == again.split == "wide_gaps@1" and next(again.rows()).axes == ("wide_gaps@1",)


# --- damage ---------------------------------------------------------------------------------------


def test_a_sound_pool_holds_with_one_worker_and_with_two(made):
    assert failures(made) == [] and failures(made, workers=2) == []


def test_one_flipped_byte_anywhere_in_a_shard_is_found(mine):
    shard = mine / "scenarios-00000.parquet"
    content = shard.read_bytes()
    for place in np.linspace(4, len(content) - 5, 7).astype(int):
        shard.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        assert failures(mine)[0] == {
            "id": shard.name,
            "verdict": "refuted",
            "reason": "the shard has a different sha256 than the manifest says",
        }


def test_a_truncated_shard_is_found_and_nothing_reads_it(mine):
    shard = mine / "scenarios-00000.parquet"
    shard.write_bytes(shard.read_bytes()[:-100])
    assert "truncated" in failures(mine)[0]["reason"]
    with pytest.raises(PoolError, match="truncated"):
        Pool.open(mine).check()


def flip_scene(row):
    return replace(row, scene_xml=row.scene_xml.replace('mass="0.0', 'mass="0.1', 1))


def flip_witness(row):
    witness = row.witness.copy()
    witness.view(np.uint8)[100, 3] ^= 1
    return replace(row, witness=witness)


def flip_params(row):
    return replace(row, params={**row.params, "count": row.params["count"] - 1})


def drop_a_parameter(row):
    """One with its nominal value: the scenario, and so its id, is the same without it."""
    return replace(row, params={name: value for name, value in row.params.items() if name != "slab.mass"})


def forge_witness(row):
    """Cut the actions short and write hashes to match: only the replay can tell."""
    forged = sha256(row.witness[:120].tobytes())
    row = replace(row, witness=row.witness[:120], witness_sha256=forged)
    return certificate_of(row, witness_sha256=forged)


def forge_scene(row):
    return with_scene(row, row.scene_xml.replace('name="tile_1"', 'name="tile_1" pos2=""', 1))


def hostile_scene(row):
    return with_scene(row, row.scene_xml.replace("<worldbody>", '<include file="/etc/passwd"/><worldbody>', 1))


def with_scene(row, text):
    forged = sha256(text)
    return certificate_of(replace(row, scene_xml=text, scene_sha256=forged), scene_sha256=forged)


def skip_a_check(row):
    checks = list(row.certificate.checks)
    checks[8] = replace(checks[8], passed=None)
    return certificate_of(row, checks=tuple(checks))


def forget_the_settling_time(row):
    return certificate_of(row, checks=tuple(replace(check, settings={}) for check in row.certificate.checks))


def foreign_task(row):
    return replace(row, task="domino_singel")


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (flip_scene, "the scene has a different sha256"),
        (flip_witness, "the witness has a different sha256"),
        (flip_params, "the id does not belong to the parameters"),
        (drop_a_parameter, "the parameters are incomplete"),
        (forge_witness, "check witness cannot have passed"),
        (forge_scene, "not the one that the family builds"),
        (hostile_scene, "contains <include>"),
        (skip_a_check, "the certificate is not complete"),
        (forget_the_settling_time, "check witness was made with other settings"),
        (foreign_task, "the task is 'domino_singel', the manifest says 'domino_single'"),
    ],
)
def test_a_forged_row_is_found_by_its_id(mine, damage, says):
    victim = next(Pool.open(mine).rows()).id
    rewritten(mine, lambda row: damage(row) if row.id == victim else None)
    found = failures(mine)
    assert [f["id"] for f in found] == [victim] and says in found[0]["reason"]


def test_a_scenario_that_occurs_twice_is_found(mine):
    first = next(Pool.open(mine).rows())
    rewritten(mine, lambda row: replace(first, index=1) if row.index == 1 else None)
    assert sum("the id occurs twice" in f["reason"] for f in failures(mine)) == 2
    rewritten(mine, lambda row: first if row.index == 1 else None)
    assert any("index 0 occurs twice" in f["reason"] for f in failures(mine))


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"format": 4}', '{"format": 4, "shards": []}', "\x00"])
def test_a_damaged_manifest_is_one_clear_error(mine, text):
    (mine / "manifest.json").write_text(text)
    with pytest.raises(PoolError, match="is damaged; restore it"):
        Pool.open(mine)


@pytest.mark.parametrize("gone", ["config", "funnel", "versions", "indices"])
def test_a_manifest_that_lacks_a_part_is_damaged(mine, gone):
    manifest = json.loads((mine / "manifest.json").read_text())
    (mine / "manifest.json").write_text(json.dumps({k: v for k, v in manifest.items() if k != gone}))
    with pytest.raises(PoolError, match="is damaged; restore it"):
        Pool.open(mine)


@pytest.mark.parametrize(
    ("number", "remedy"), [(1, "generate it again with the command and seed"), (99, "install a newer scengen")]
)
def test_a_pool_of_another_format_is_one_clear_error(mine, number, remedy):
    manifest = json.loads((mine / "manifest.json").read_text())
    (mine / "manifest.json").write_text(json.dumps({**manifest, "format": number}))
    with pytest.raises(
        PoolError,
        match=f"has pool format {number}, this scengen reads {FORMAT}; {remedy}",
    ):
        Pool.open(mine)


def uncanonical(columns):
    columns["params"][1] = columns["params"][1].replace(", ", ",")


def gap(columns):
    columns["instruction"][1] = None


def gap_in_a_certificate(columns):
    columns["certificate"][1]["source_sha256"] = None


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (uncanonical, "from row 1 on .*not a mapping in canonical JSON"),
        (gap, "column instruction has missing values"),
        (gap_in_a_certificate, "from row 1 on .*the certificate lacks source_sha256"),
        (lambda columns: columns.pop("id_twin"), "its columns are not those of pool format 4"),
    ],
)
def test_a_shard_that_is_no_table_of_rows_is_one_clear_error(mine, damage, says):
    """With hashes that match, as of an untrusted pool."""
    path = mine / "scenarios-00000.parquet"
    columns = pq.read_table(path).to_pydict()
    damage(columns)
    pq.write_table(pa.table(columns, schema=pa.schema([f for f in SCHEMAS[7] if f.name in columns])), path)
    manifest = json.loads((mine / "manifest.json").read_text())
    manifest["shards"][0] |= {"bytes": path.stat().st_size, "sha256": sha256(path.read_bytes())}
    (mine / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(PoolError, match=says):
        list(Pool.open(mine).check().rows())
    assert failures(mine)[0]["id"] == "shards"


def made_with(folder, **changed):
    """Let manifest and rows say that the pool was made with something else."""
    opened = Pool.open(folder)
    rows = [certificate_of(row, **changed) for row in opened.rows()]
    manifest = {key: value for key, value in changed.items() if hasattr(opened.manifest, key)}
    return write_pool(folder, replace(opened.manifest, **manifest), rows)


def test_the_code_that_made_a_pool_decides_nothing(mine):
    made_with(mine, source_sha256="0" * 64)
    assert examined(mine).holds


def test_a_pool_of_another_version_that_reproduces_is_sound_and_says_so(mine):
    made_with(mine, task_version=3)
    report = examined(mine)
    assert (report.verdict, report.sound, report.claimed, report.versions) == ("sound", 3, 0, [3, 2])
    assert any("certified against version 3 of domino_single; installed: 2" in remark for remark in report.remarks)


def test_what_differs_from_another_version_is_a_claim(mine, monkeypatch):
    """A rule has changed since: the witness fails now. On the same version that refutes the scenario."""
    monkeypatch.setattr(DominoSingle, "success", lambda self, world: False)
    assert {f["verdict"] for f in failures(mine)} == {"refuted"}
    monkeypatch.setattr(DominoSingle, "VERSION", 2)
    report = examined(mine)
    assert (report.verdict, report.sound, report.declined, report.claimed) == ("declined", 0, 3, 3)
    reason = report.failed[0]["reason"]
    assert reason.startswith("certified against version 1 of domino_single; installed: 2, where the witness fails")
    again = examined(mine, level="full")
    assert again.claimed == 3
    assert "certified again against version 2 it is unknown solved: the oracle failed" in again.failed[0]["reason"]


def test_faults_that_need_no_code_stay_faults_of_another_version(mine):
    made_with(mine, task_version=2, scene_sha256="0" * 64)
    assert {f["verdict"] for f in failures(mine)} == {"refuted"}


@pytest.mark.parametrize("level", ["replay", "recheck", "full"])
def test_a_report_names_the_checks_that_it_did_not_make_again(mine, level):
    claimed = examined(mine, level=level).claimed_checks
    left = {
        "replay": {"overlap", "rest", "shortcuts", "robust"},
        "recheck": {"shortcuts", "solved", "robust"},
        "full": set(),
    }
    assert left[level] <= set(claimed) and bool(claimed) == (level != "full")


def test_on_a_machine_that_rounds_otherwise_the_verdict_counts_and_not_the_bits(mine):
    made_with(mine, fingerprint="0" * 16, final_state="0" * 16)
    report = examined(mine)
    assert report.holds and report.drifted == 3


def test_on_the_same_machine_other_bits_fail(mine):
    rewritten(mine, lambda row: certificate_of(row, final_state="0" * 16))
    assert all("ends in another state" in f["reason"] for f in failures(mine))


def test_verification_needs_no_oracle(made, tmp_path):
    """Delete the `oracle` of every family from a copy of the package and verify with the copy."""
    copy = tmp_path / "tree"
    shutil.copytree(ROOT / "scengen", copy / "scengen")  # with what was compiled of its control loop
    shutil.copytree(ROOT / "conf", copy / "conf")
    removed = 0
    for path in (copy / "scengen" / "tasks").glob("*.py"):
        tree = ast.parse(path.read_text())
        lines = path.read_text().splitlines(keepends=True)
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and node.name == "oracle":
                lines[node.lineno - 1 : node.end_lineno] = [""] * (node.end_lineno - node.lineno + 1)
                removed += 1
        path.write_text("".join(lines))
    assert removed >= 1
    result = subprocess.run(
        [sys.executable, "-m", "scengen", "verify", f"pool={made}", f"json={tmp_path / 'v.json'}"],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
    report = json.loads((tmp_path / "v.json").read_text())
    assert (report["verdict"], report["checked"], report["sound"], report["rechecked"]) == ("sound", 3, 3, 3)
