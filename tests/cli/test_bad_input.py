"""Input that no command can use is refused in one line that says what would be right."""

import pytest
from pools import make

from scengen import cli


@pytest.fixture(scope="module")
def empty(tmp_path_factory):
    """A pool of a run that certified nothing."""
    folder = tmp_path_factory.mktemp("empty") / "pool"
    make(folder, "task.horizon=0.5", n=1, limit=1)
    return folder


@pytest.mark.parametrize(
    "argv",
    [
        ("report", "audit"),
        ("report", "compare"),
        ("subset", "to=there"),
        ("attack",),
        ("verify", "robosuite"),
        ("record", "to=there"),
        ("evaluate", "policy=idle", "to=there"),
        ("export", "hub", "to=there"),
    ],
)
def test_a_pool_without_scenarios_is_refused_by_what_needs_some(empty, argv, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.run([*argv, f"pool={empty}"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "no scenario" in told and str(empty) in told and not list(tmp_path.iterdir())


REFERENCE = "pool=generated/reference/domino_single-id"


@pytest.mark.parametrize(
    ("argv", "told"),
    [
        (("asset", "units=nope"), "units: settings of an imported mesh; give mesh=FILE"),
        (("asset", "friction=nan"), "friction: settings of an imported mesh"),
        (("asset", "friction=inf", "pieces=0"), "friction, pieces: settings of an imported mesh"),
        (("asset", "name=cup", "to=cup.stl", "mass=3"), "mass: settings of an imported mesh"),
        (("asset", "mesh=x.stl", "to=x", "friction=nan"), "friction = nan"),
        (("attack", "task=domino_single", "tiers=[]"), "tiers = []; an attack without tiers finds nothing; give some"),
        (("export", "hub", REFERENCE, "to=there", 'license="a\nb"'), "must be one line of text"),
        (("export", "hub", REFERENCE, "to=there", "title=' '"), "must be one line of text"),
        (("verify", REFERENCE, "executor=[]"), "file of conf/executor without .yaml; known: local, ray"),
        (("verify", REFERENCE, "executor={}"), "file of conf/executor without .yaml; known: local, ray"),
        (("verify", REFERENCE, "executor=null"), "conf/executor"),
        (("verify", REFERENCE, "ycb=here"), "holds no scans; leave it out"),
        (("tasks", "hydra.searchpath=[pkg://nope.nope]"), "there is no folder pkg://nope.nope; give one"),
        (("tasks", "hydra.searchpath=[pkg://nope]"), "there is no folder pkg://nope; give one"),
        (("generate", "task=packing", "hydra.searchpath=[file:///nowhere]"), "there is no folder /nowhere"),
        (("show", "film", REFERENCE, "id=8ed4", "to=x.png", "raw=true"), "raw = true plays a shortcut"),
    ],
)
def test_values_without_a_meaning_are_refused_before_any_work(argv, told, capsys, monkeypatch, recwarn):
    assert cli.run(argv) == 2
    line = capsys.readouterr().err
    assert told in line and line.count("\n") == 1 and not list(recwarn)
