"""The robot's files are found in three ways, compared with the release, and missed in one line."""

import os
import subprocess
import sys
import zipfile
from importlib.metadata import PackageNotFoundError

import mujoco
import pytest

from scengen.errors import NoRobot
from scengen.robots import download, files, panda

WAYS = (files.INSTALL, files.DOWNLOAD, files.VARIABLE)
XML = "robots/panda/robot.xml"
CACHES = (files.place, files.checked, panda._arm, panda._mount, panda._jaw)
"""What a process keeps of the robot."""


@pytest.fixture(scope="module")
def here():
    """The folder from which the other tests read the robot."""
    return files.place().folder


@pytest.fixture
def alone(here, monkeypatch, tmp_path):
    """No place at all: without the variable, an installed robosuite, and a cache."""

    def none(name):
        raise PackageNotFoundError(name)

    monkeypatch.delenv(files.VARIABLE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(files, "distribution", none)
    for cached in CACHES:
        cached.cache_clear()
    yield
    for cached in CACHES:
        cached.cache_clear()


class Installed:
    """Metadata of a robosuite that lies in a folder."""

    def __init__(self, folder, version):
        self.folder, self.version = folder, version

    def locate_file(self, path):
        return self.folder / path


def linked(here, folder, without=()):
    """A folder with links to the robot's files."""
    for name in files.hashes().keys() - set(without):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).symlink_to(here / name)
    return folder


def loaded(visual=False):
    """Number of meshes of a robot that is read now."""
    scene = mujoco.MjSpec()
    panda.attach(scene, visual)
    return len(scene.meshes)


@pytest.mark.parametrize("inner", ["", "models/assets", "robosuite/models/assets"])
def test_the_variable_names_a_folder_on_any_level(alone, here, tmp_path, monkeypatch, inner):
    linked(here, tmp_path / "files" / inner)
    monkeypatch.setenv(files.VARIABLE, str(tmp_path / "files"))
    assert loaded() == 10 and files.place().folder == tmp_path / "files" / inner


def test_an_installed_robosuite_is_found_by_its_metadata_and_not_imported(alone, here, tmp_path, monkeypatch):
    folder = linked(here, tmp_path / files.ASSETS)
    monkeypatch.setattr(files, "distribution", lambda name: Installed(tmp_path, "1.5.1"))  # the same files
    assert loaded() == 10 and files.place().folder == folder
    program = "import sys; from scengen.robots import ik; ik._arm(); sys.exit('robosuite' in sys.modules)"
    assert not subprocess.run([sys.executable, "-c", program]).returncode


def test_the_cache_is_filled_from_a_wheel(alone, here, tmp_path, monkeypatch, capsys):
    with zipfile.ZipFile(tmp_path / "robosuite.whl", "w") as archive:
        archive.writestr("robosuite/__init__.py", "")
        for name in files.hashes():
            archive.write(here / name, f"{files.ASSETS}/{name}")
    monkeypatch.setattr(download, "wheel", lambda folder: tmp_path / "robosuite.whl")
    assert download.main() == 0 and f"are in {files.cached_folder()}" in capsys.readouterr().out
    assert {path.relative_to(files.cached_folder()).as_posix() for path in files.cached_folder().rglob("*.*")} == set(
        files.hashes()
    )
    assert loaded(visual=True) > 60
    monkeypatch.setattr(download, "wheel", lambda folder: pytest.fail("a full cache is not filled again"))
    assert download.main() == 0


def test_a_wheel_with_another_file_is_refused(alone, tmp_path, monkeypatch, capsys):
    with zipfile.ZipFile(tmp_path / "robosuite.whl", "w") as archive:
        archive.writestr(f"{files.ASSETS}/{XML}", "<mujoco/>")
    monkeypatch.setattr(download, "wheel", lambda folder: tmp_path / "robosuite.whl")
    assert download.main() == 2 and "in robosuite.whl is not that of robosuite" in capsys.readouterr().err


def test_a_failure_of_pip_is_one_line(alone, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    assert download.main() == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2 and "pip cannot download robosuite" in told[1] and files.VARIABLE in told[1]


def test_the_variable_comes_before_the_installed_robosuite_and_that_before_the_cache(
    alone, here, tmp_path, monkeypatch
):
    linked(here, files.cached_folder())
    places = [files._cached()]
    linked(here, tmp_path / "installed" / files.ASSETS)
    monkeypatch.setattr(files, "distribution", lambda name: Installed(tmp_path / "installed", "1.5.2"))
    places.append(files.place())
    monkeypatch.setenv(files.VARIABLE, str(linked(here, tmp_path / "named")))
    files.place.cache_clear()
    places.append(files.place())
    assert [place.folder for place in places if place] == [
        files.cached_folder(),
        tmp_path / "installed" / files.ASSETS,
        tmp_path / "named",
    ]


def test_where_there_is_no_robot_one_line_names_the_three_ways(alone, capsys):
    with pytest.raises(NoRobot) as error:
        loaded()
    assert all(way in str(error.value) for way in WAYS) and "\n" not in str(error.value)


def test_a_variable_that_names_no_folder_is_an_error(alone, tmp_path, monkeypatch):
    monkeypatch.setenv(files.VARIABLE, str(tmp_path / "gone"))
    with pytest.raises(
        NoRobot, match="gone, which is not a folder; set it to a folder with robosuite 1.5.2, or unset it"
    ):
        loaded()


@pytest.mark.parametrize("name", [XML, "grippers/meshes/panda_gripper/finger.stl"])
@pytest.mark.parametrize("fault", ["damaged", "missing"])
def test_a_file_that_is_another_one_or_missing_is_named(alone, here, tmp_path, monkeypatch, name, fault):
    folder = linked(here, tmp_path / files.ASSETS, without=[name])
    if fault == "damaged":
        (folder / name).write_bytes((here / name).read_bytes() + b" ")
    monkeypatch.setattr(files, "distribution", lambda name: Installed(tmp_path, "1.4.0"))
    with pytest.raises(NoRobot) as error:
        loaded()
    told = str(error.value)
    assert name in told and "the installed robosuite 1.4.0" in told and "--force-reinstall robosuite==1.5.2" in told


def test_physics_alone_need_no_visual_mesh(alone, here, tmp_path, monkeypatch):
    visual = [name for name in files.hashes() if name.endswith(".obj")]
    monkeypatch.setenv(files.VARIABLE, str(linked(here, tmp_path, without=visual)))
    assert loaded() == 10
    with pytest.raises(NoRobot, match=r"\.obj cannot be read in"):
        loaded(visual=True)


def test_an_import_does_not_need_the_robot(tmp_path):
    line = [sys.executable, "-c", "from scengen.robots import ik, suction; from scengen.sim import world"]
    ended = subprocess.run(line, env={**os.environ, files.VARIABLE: str(tmp_path / "gone")}, capture_output=True)
    assert ended.returncode == 0, ended.stderr


def test_the_list_names_what_the_robot_uses_and_nothing_else(here):
    specs = {name: mujoco.MjSpec.from_file(str(here / name)) for name in files.hashes() if name.endswith(".xml")}
    used = {f"{name.rpartition('/')[0]}/{mesh.file}" for name, spec in specs.items() for mesh in spec.meshes}
    assert used | specs.keys() == files.hashes().keys() and len(specs) == 3
