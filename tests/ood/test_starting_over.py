"""Cards and searches of axes continue, and start over by a word; nothing is deleted."""

from scengen import cli

CARD = ("axis", "card", "task=domino_single", "axis=stout_starter", "n=2", "any_n=0", "belief_n=0", "certify_n=0")


def test_a_card_continues_or_starts_over(tmp_path, capsys):
    command = (*CARD, "rounds=0", f"to={tmp_path / 'card'}")
    assert cli.run(command) == 0 and "of an earlier run" not in capsys.readouterr().out
    log = tmp_path / "card" / "twins.jsonl"
    first = log.read_bytes()
    assert cli.run(command) == 0
    assert "2 twins and trials of an earlier run are kept; fresh=true starts over" in capsys.readouterr().out
    assert log.read_bytes() == first
    assert cli.run((*command, "seed=1")) == 2
    assert "give fresh=true to move them aside" in capsys.readouterr().err
    assert cli.run((*command, "seed=1", "fresh=true")) == 0
    assert "are moved aside, and made again" in capsys.readouterr().out
    assert log.with_name("twins-1.jsonl").read_bytes() == first != log.read_bytes()
    assert (tmp_path / "card" / "domino_single-id" / "own-1.jsonl").is_file()


def test_a_search_starts_over(tmp_path, capsys):
    command = ("axis", "discover", "task=domino_single", "budget=70", "method=hypercube", f"to={tmp_path}")
    assert cli.run(command) == 0
    first = (tmp_path / "trials.jsonl").read_bytes()
    assert cli.run((*command, "seed=1", "fresh=true")) == 0
    assert " trials of an earlier run are moved aside" in capsys.readouterr().out
    assert (tmp_path / "trials-1.jsonl").read_bytes() == first
