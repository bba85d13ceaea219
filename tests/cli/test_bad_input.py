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
        ("audit",),
        ("compare",),
        ("subset", "to=there"),
        ("attack",),
        ("crosscheck",),
        ("record", "to=there"),
        ("evaluate", "policy=idle", "to=there"),
        ("publish", "to=there"),
    ],
)
def test_a_pool_without_scenarios_is_refused_by_what_needs_some(empty, argv, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.run([*argv, f"pool={empty}"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "no scenario" in told and str(empty) in told and not list(tmp_path.iterdir())
