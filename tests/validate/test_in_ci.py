"""What CI systems read: exit status, JUnit XML, and pipes whose reader has gone."""

import io
import json
import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest
from helpers import REFERENCE, of_stored_pools

from scengen import cli
from scengen.cli.program import DECLINED, LastingFile
from scengen.errors import contrasted
from scengen.installation import versions
from scengen.pool import Pool
from scengen.validate.lock import LOCK_FILE
from scengen.validate.verify.findings import differences

pytestmark = of_stored_pools


def suites(tmp_path, *words):
    """Exit status of a verification, and the suites of its file."""
    file = tmp_path / "out.xml"
    status = cli.run(["verify", "level=replay", f"junit={file}", *words])
    return status, ET.fromstring(file.read_text()).findall("testsuite")


def properties(suite):
    return {each.attrib["name"]: each.attrib["value"] for each in suite.findall("properties/property")}


def test_what_was_not_simulated_is_skipped_and_every_case_has_a_time(tmp_path, capsys):
    status, (suite,) = suites(tmp_path, f"pool={REFERENCE}", "sample=2", "seed=7")
    counts = {name: suite.attrib[name] for name in ("tests", "failures", "errors", "skipped")}
    assert status == 0 and counts == {"tests": "6", "failures": "0", "errors": "0", "skipped": "4"}
    cases = suite.findall("testcase")
    assert sum(case.find("skipped") is not None for case in cases) == 4
    times = [float(case.attrib["time"]) for case in cases]
    assert min(times) > 0.0 and float(suite.attrib["time"]) == pytest.approx(sum(times), abs=1e-6)
    about = properties(suite)
    assert about["level"] == "replay" and about["sample_seed"] == "7" and about["sample_size"] == "2"
    assert about["pool_sha256"] == Pool.open(REFERENCE).sha256 and versions().items() <= about.items()
    told = capsys.readouterr().out
    assert "2 of 6 scenarios simulated, seed 7: at most 66.7 % of the scenarios can be bad (95 % confidence)" in told


def test_scenarios_that_were_not_read_are_one_skipped_case(tmp_path):
    _, (suite,) = suites(tmp_path, f"pool={REFERENCE}", "sample=1", "others=skip")
    assert [suite.attrib[name] for name in ("tests", "skipped")] == ["2", "1"]
    assert suite.findall("testcase")[-1].attrib["name"] == "5 other scenarios"


def test_a_missing_pool_is_an_error_of_its_own_beside_those_that_were_verified(tmp_path):
    status, (suite,) = suites(tmp_path, f"pool={tmp_path / 'nowhere'}")
    error = suite.find("testcase/error")
    assert status == 2 and "nowhere: manifest.json is missing" in error.attrib["message"]
    assert suite.attrib["errors"] == suite.attrib["tests"] == "1" and properties(suite)["level"] == "replay"
    status, found = suites(tmp_path, f"pool={REFERENCE},{tmp_path / 'nowhere'}", "sample=1")
    assert status == 2 and [suite.attrib["errors"] for suite in found] == ["0", "1"]
    assert found[1].attrib["name"] == f"scengen verify {tmp_path / 'nowhere'}"


def test_json_is_written_for_a_missing_pool_too(tmp_path):
    file, nowhere = tmp_path / "out.json", tmp_path / "nowhere"
    assert cli.run(["verify", f"pool={nowhere}", f"json={file}"]) == 2
    assert "manifest.json is missing" in json.loads(file.read_text())["error"]
    assert cli.run(["verify", f"pool={REFERENCE},{nowhere}", "level=replay", "sample=1", f"json={file}"]) == 2
    told = json.loads(file.read_text())
    assert told[str(REFERENCE)]["verdict"] == "sound" and "is missing" in told[str(nowhere)]["error"]


def test_a_missing_pool_is_told_with_the_nearest_folder_beside_it(of_another_mujoco, capsys):
    assert cli.run(["verify", f"pool={of_another_mujoco}d"]) == 2
    told = f"oldd (did you mean {str(of_another_mujoco)!r}?): manifest.json is missing"
    assert told in capsys.readouterr().err


@pytest.fixture
def of_another_mujoco(tmp_path):
    """A pool that says that it was certified with another MuJoCo."""
    shutil.copytree(REFERENCE, tmp_path / "old")
    path = tmp_path / "old" / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["versions"]["mujoco"] = "3.1.0"
    path.write_text(json.dumps(manifest))
    (path.parent / LOCK_FILE).unlink()  # it names the versions, too
    return path.parent


def test_a_pool_that_cannot_be_judged_here_is_declined_and_not_bad_input(of_another_mujoco, tmp_path, capsys):
    status, (suite,) = suites(tmp_path, f"pool={of_another_mujoco}")
    assert status == DECLINED == 3 and suite.find("testcase/error").attrib["type"] == "declined"
    assert cli.run(["record", f"pool={of_another_mujoco}", f"to={tmp_path / 'recorded'}"]) == 3
    assert "was certified with mujoco 3.1.0, this is" in capsys.readouterr().err


def test_a_refuted_pool_fails_although_another_one_is_declined(of_another_mujoco, tmp_path):
    shutil.copytree(REFERENCE, tmp_path / "wrong")
    path = tmp_path / "wrong" / "manifest.json"
    path.write_text(path.read_text().replace('"first_draws": 6', '"first_draws": 5'))
    assert suites(tmp_path, f"pool={of_another_mujoco},{tmp_path / 'wrong'}", "sample=1")[0] == 1


@pytest.mark.parametrize("setting", ["hits=x", "results=x", "task=packing"])
def test_what_writes_no_such_file_says_so(setting, tmp_path, capsys):
    assert cli.run(["verify", setting, f"junit={tmp_path / 'out.xml'}"]) == 2
    assert "junit is" in capsys.readouterr().err


# --- differences --------------------------------------------------------------------------------------


def test_differences_are_cut_where_they_agree():
    assert contrasted("a", "b") == ("a", "b")
    one, other = contrasted("x" * 500 + "here" + "y" * 500, "x" * 500 + "there" + "y" * 500)
    assert one == "..." + "x" * 20 + "here" + "y" * 36 + "..." and "xthere" in other and len(other) == 66
    assert contrasted("x" * 100, "x" * 101) == ("..." + "x" * 20, "..." + "x" * 21)
    assert contrasted("1 " + "x" * 90, "2 " + "x" * 90)[0] == "1 " + "x" * 58 + "..."


def test_long_values_of_a_task_are_told_apart():
    why = "a long reason " * 40
    (found,) = differences({"axes": {"why": f"{why}today"}}, {"axes": {"why": f"{why}then"}})
    assert found["installed"].endswith("today") and found["pool"].endswith("then") and len(found["pool"]) < 210


# --- pipes --------------------------------------------------------------------------------------------


def test_a_stream_outlives_its_reader():
    reader, writer = os.pipe()
    os.close(reader)
    with LastingFile(writer, "w") as file:
        text = io.TextIOWrapper(io.BufferedWriter(file))
        for _ in range(3):
            text.write("lost\n" * 100_000)
            text.flush()


@pytest.mark.parametrize(("pool", "status"), [(REFERENCE, 0), ("nowhere", 2)])
def test_a_command_whose_reader_has_gone_ends_with_its_own_status(pool, status):
    line = f"{sys.executable} -m scengen show pool={pool} 2>&1 | true; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (status, "", "")


def test_closed_streams_are_no_fault():
    line = f"{sys.executable} -m scengen nope >&- 2>&-; exit $?"
    assert subprocess.run(["bash", "-c", line], capture_output=True).returncode == 2
