"""fresh=true: an earlier run and its pool are moved aside, and nothing else is."""

from dataclasses import replace

import pytest
from helpers import REFERENCE

from scengen import cli
from scengen.attack import campaign
from scengen.attack.experience import Experience
from scengen.cli.commands.generate import _draws
from scengen.errors import PoolError
from scengen.pool import Pool
from scengen.pool.manifest import MANIFEST
from scengen.runs.journal import Journal, Record, begun, start_over

RECORD = Record(0, "unknown", "solved", "why", 1, {}, None, 0.5)


def run(pool, identity, records):
    """A run that stores some records and ends."""
    journal = Journal(pool, {"source_sha256": identity})
    for index in range(records):
        journal.add(replace(RECORD, index=index))
    journal.close()


def test_an_edited_task_is_refused_by_its_name_and_starts_over_with_a_word(tmp_path):
    pool = tmp_path / "pool"
    run(pool, "one", 3)
    assert begun(pool) == 3 and begun(tmp_path / "other") == 0
    with pytest.raises(PoolError, match=r"other settings \(the code of the task\); give fresh=true to move it aside"):
        run(pool, "two", 1)
    assert start_over(pool) == [tmp_path / "pool-1.run"]
    run(pool, "two", 1)
    assert begun(pool) == 1 and begun(tmp_path / "pool-1") == 3
    (pool / MANIFEST).parent.mkdir()
    (pool / MANIFEST).write_text("{}")
    assert start_over(pool) == [tmp_path / "pool-2", tmp_path / "pool-2.run"], "a pool and its run have one number"


def test_only_what_a_run_has_made_is_moved(tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    (home / "thesis.tex").touch()
    assert start_over(home) == [] and (home / "thesis.tex").exists()
    other = tmp_path / "recording"
    (other / "meta").mkdir(parents=True)
    (other / "demonstrations.json").touch()
    with pytest.raises(PoolError, match="already"):
        start_over(other)


def test_a_pool_that_is_being_written_is_not_moved(tmp_path):
    journal = Journal(tmp_path / "pool", {})
    with pytest.raises(PoolError, match="another run is writing"):
        start_over(tmp_path / "pool")
    journal.close()
    assert start_over(tmp_path / "pool")


def test_an_attack_says_what_is_there_before_it_plays(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(campaign, "experience", lambda *_: Experience())  # which random plans do not use
    words = ["attack", f"pool={REFERENCE}", "n=1", "budget=2", "tiers=[random]", f"to={tmp_path / 'hits'}"]
    assert cli.run(words) == 0 and "earlier run" not in capsys.readouterr().out
    assert cli.run([*words, "seed=1"]) == 2
    shown = capsys.readouterr()
    assert "1 attacked scenarios of an earlier run are kept; fresh=true starts over" in shown.out
    assert "(seed); give fresh=true" in shown.err
    assert cli.run([*words, "seed=1", "fresh=true"]) == 0 and "are moved aside" in capsys.readouterr().out
    assert campaign.begun(tmp_path / "hits") == campaign.begun(tmp_path / "hits-1") == 1
    (tmp_path / "mine").mkdir()
    assert cli.run([*words[:-1], f"to={tmp_path / 'mine'}", "fresh=true"]) == 0
    assert not (tmp_path / "mine-1").exists(), "a folder without an attack stays where it is"


def test_draws_ahead_of_a_pool_are_told_apart(tmp_path):
    """Several workers finish more draws than a pool of n scenarios lists."""
    listed = Pool.open(REFERENCE).manifest.indices
    assert _draws(tmp_path, 7) == _draws(REFERENCE, listed) == "draws"
    assert _draws(REFERENCE, listed + 1) == f"draws ({listed} of them in its pool)"
