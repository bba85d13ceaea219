"""scengen.lock: what a pool was made with, as pip reads it; derived from the manifest, which counts."""

import json
import shutil
import subprocess
import sys
from importlib.util import find_spec

import pytest
from pools import QUICKLY, make

from scengen import cli, list_tasks, load_task
from scengen.errors import PoolError
from scengen.installation import versions
from scengen.pool import Pool
from scengen.validate import identity, lock


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A pool as generate leaves it."""
    return make(tmp_path_factory.mktemp("lock") / "pool", n=1).pool.folder


@pytest.fixture
def pool(made, tmp_path):
    """A copy that may be changed."""
    shutil.copytree(made, tmp_path / "pool")
    return tmp_path / "pool"


def verified(folder, tmp_path):
    """Exit status and report of `scengen verify`."""
    report = tmp_path / "report.json"
    status = cli.run(("verify", f"pool={folder}", "level=replay", f"json={report}"))
    return status, json.loads(report.read_text())


def other(folder, package, version):
    """Let the file name another version of a package."""
    path = folder / lock.LOCK_FILE
    before = path.read_text()
    told = lock.read_lock(folder)
    path.write_text(before.replace(f"{package}=={told[package]}", f"{package}=={version}"))
    assert path.read_text() != before


def test_the_file_names_what_is_installed_and_what_the_manifest_says(made):
    opened, locked = Pool.open(made), lock.read_lock(made)
    assert {name: told for name, told in opened.manifest.versions.items() if name in locked} == {
        name: versions()[name] for name in ("mujoco", "robosuite", "numpy") if name != "robosuite" or find_spec(name)
    }
    assert {"numba", "llvmlite", "scipy"} < set(locked)
    for line in (opened.manifest.source_sha256, opened.manifest.fingerprint, "python 3."):
        assert line in (made / lock.LOCK_FILE).read_text()


def test_pip_takes_the_file_as_requirements_and_as_constraints(made):
    """All of it is installed here: pip reads every line, finds it satisfied, and asks no index."""
    file = made / lock.LOCK_FILE
    for given in (["-r", file], ["-c", file, "mujoco"]):
        asked = ["install", "--dry-run", "--no-deps", "--no-index", *given]
        done = subprocess.run([sys.executable, "-m", "pip", *map(str, asked)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert "Would install" not in done.stdout


def test_everything_that_a_family_imports_is_named():
    """The cage is cut out with manifold3d: the lock of its task names it, that of no other does."""
    found = {name: identity.packages(load_task(name).family) for name in list_tasks()}
    assert all({"mujoco", "numpy", "numba", "scipy"} <= set(packages) for packages in found.values())
    assert [name for name, packages in found.items() if "manifold3d" in packages] == ["ball_cage_escape"]
    assert not any("scengen" in packages for packages in found.values())


def test_a_pool_without_the_file_and_one_with_it_are_sound(pool, tmp_path):
    assert verified(pool, tmp_path)[0] == 0
    (pool / lock.LOCK_FILE).unlink()
    assert verified(pool, tmp_path)[0] == 0


def test_another_version_is_told_with_the_way_to_its_environment(pool, tmp_path):
    other(pool, "scipy", "1.11.0")
    status, report = verified(pool, tmp_path)
    (told,) = report["remarks"]
    assert status == 0 and told.startswith("made with scipy 1.11.0 (here ")
    assert f"pip install --no-deps -r {pool / lock.LOCK_FILE}" in told


def test_a_pool_of_another_mujoco_is_declined_with_the_way_to_its_environment(pool, tmp_path):
    other(pool, "mujoco", "3.4.0")
    manifest = json.loads((pool / "manifest.json").read_text())
    manifest["versions"]["mujoco"] = "3.4.0"
    (pool / "manifest.json").write_text(json.dumps(manifest))
    status, report = verified(pool, tmp_path)
    assert status == 3 and any(f"-r {pool / lock.LOCK_FILE}" in told for told in report["remarks"])


def test_a_file_that_contradicts_the_manifest_is_refuted(pool, tmp_path):
    other(pool, "mujoco", "3.4.0")
    status, report = verified(pool, tmp_path)
    (fault,) = report["failed"]
    assert status == 1 and fault["id"] == lock.LOCK_FILE and "it says mujoco 3.4.0, the manifest" in fault["reason"]
    assert not report["remarks"], "nobody is told to install from it"


def test_nobody_is_told_to_install_what_no_verdict_touches(pool, tmp_path):
    other(pool, "scipy", "1.11.0")
    with (pool / lock.LOCK_FILE).open("a") as file:
        file.write("mujocco==3.5.0\n")
    status, report = verified(pool, tmp_path)
    (told,) = report["remarks"]
    assert status == 0 and "mujocco" in told and "do not install" in told and "pip" not in told


@pytest.mark.parametrize(
    "line",
    ["--index-url https://example.org", "scipy @ file:///tmp/x", "-r other.txt", "scipy>=1", "numba==1\nnumba==2"],
)
def test_a_line_that_does_more_than_name_a_version_is_refuted(pool, tmp_path, line):
    with (pool / lock.LOCK_FILE).open("a") as file:
        file.write(f"{line}\n")
    with pytest.raises(PoolError, match=r"line \d+ is not `package==version`"):
        lock.read_lock(pool)
    status, report = verified(pool, tmp_path)
    assert status == 1 and report["failed"][0]["id"] == lock.LOCK_FILE


def test_a_link_is_not_followed(pool):
    (pool / lock.LOCK_FILE).unlink()
    (pool / lock.LOCK_FILE).symlink_to("/etc/passwd")
    with pytest.raises(PoolError, match="is not a plain file"):
        lock.read_lock(pool)


def test_a_run_is_not_continued_with_other_packages(made, tmp_path, capsys):
    """Else the file of the finished pool would tell of one of them alone."""
    for name in ("pool", "pool.run"):
        shutil.copytree(made.with_name(name), tmp_path / name)
    again = ("generate", "task=domino_single", "n=1", f"pool={tmp_path / 'pool'}", *QUICKLY)
    assert cli.run(again) == 0
    other(tmp_path / "pool.run", "numba", "0.50.0")
    capsys.readouterr()
    assert cli.run(again) == 2 and "was started with numba 0.50.0" in capsys.readouterr().err


def test_a_subset_keeps_the_file(made, tmp_path):
    assert cli.run(("subset", f"pool={made}", "n=1", f"to={tmp_path / 'some'}")) == 0
    assert (tmp_path / "some" / lock.LOCK_FILE).read_bytes() == (made / lock.LOCK_FILE).read_bytes()


def test_a_subset_that_was_killed_when_all_was_written_can_be_repeated(made, tmp_path, capsys):
    asked = ("subset", f"pool={made}", "n=1", f"to={tmp_path / 'some'}")
    assert cli.run(asked) == 0
    written = {path.name: path.read_bytes() for path in (tmp_path / "some").iterdir()}
    assert cli.run(asked) == 0 and "holds this subset already" in capsys.readouterr().out
    assert written == {path.name: path.read_bytes() for path in (tmp_path / "some").iterdir()}
    assert cli.run((*asked[:-1], f"to={made}")) == 2 and "not this subset" in capsys.readouterr().err
