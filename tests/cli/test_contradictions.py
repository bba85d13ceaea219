"""Settings that no draw can ever meet are refused before the first draw, with what can be met."""

import pytest

from scengen import cli
from scengen.errors import BadConfig
from scengen.validate.certify import lower_bound
from scengen.validate.settings import CertifySettings, Robust

DOMINO = "task=domino_single"
REFERENCE = "pool=generated/reference/domino_single-id"


@pytest.mark.parametrize(
    ("argv", "told"),
    [
        (("generate", "certify.robust.runs=2"), "certify.robust.runs=4, or certify.robust.bound=0.22"),
        (("generate", "certify.robust.bound=0.9"), "certify.robust.runs=29, or certify.robust.bound=0.47"),
        (("generate", "certify.robust.bound=1"), "show 0.473; give certify.robust.bound=0.47"),
        (("axis", "card", "axis=diagonal", "certify.robust.runs=2"), "cannot be met"),
        (("generate", "certify.rest.drift=0"), "certify.rest.drift = 0.0; it must lie in [1e-05, 0.1] m"),
        (("generate", "certify.attack=1"), "a plan is played filtered and raw; give 0, or 2 or more"),
        (("generate", "n=5", "limit=3"), "limit = 3; 5 scenarios need at least as many tries; give limit=5"),
        (("generate", "n=600", "sampler=grid:2"), "sampler=grid:2 has 512 different ones; give n=512 or less"),
        (("generate", "n=2", "task.id={}", "task.id=null"), "because no parameter varies; give n=1"),
        (("generate", "n=20", "attack=39"), "attack = 39 for 20 scenarios"),
        (("demos", "limit=3"), "limit = 3; 200 demonstrations need at least as many tries; give limit=200"),
        (("demos", "n=1025", "sampler=grid:2", "runs=2"), "has 512 scenarios, with 2 runs each; give n=1024 or less"),
        (("demos", "pad", "n=5", "limit=4"), "limit = 4; 5 demonstrations need"),
        (("attack", "n=5", "budget=9"), "which needs 10 rollouts; give budget=10 or more, or fewer scenarios"),
    ],
)
def test_what_no_draw_can_meet_is_refused_before_the_first_draw(argv, told, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    place = 2 if argv[0] == "axis" or argv[1] == "pad" else 1
    assert cli.run([*argv[:place], DOMINO, *argv[place:]]) == 2
    shown = capsys.readouterr().err
    assert told in shown and shown.count("\n") == 1 and not list(tmp_path.iterdir())


@pytest.mark.parametrize("runs", [1, 4, 14, 1000])
def test_a_bound_that_its_runs_just_show_is_accepted(runs):
    shown = lower_bound(runs, runs)
    CertifySettings(robust=Robust(runs=runs, bound=shown)).check()
    with pytest.raises(BadConfig, match="cannot be met"):
        CertifySettings(robust=Robust(runs=runs, bound=shown + 1e-9)).check()


def test_a_pool_smaller_than_n_counts_for_the_budget(capsys):
    assert cli.run(["attack", REFERENCE, "n=100", "budget=1"]) == 2
    assert "for 6 scenarios" in capsys.readouterr().err
