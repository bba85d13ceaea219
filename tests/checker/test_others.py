"""Nothing false is sound and unsaid: demonstrations, rollouts, recordings, and folders that are two things."""

import re
import shutil

import pytest
from others import DEMONSTRATIONS, MIXED, RECORDINGS, REFERENCE, forge, honest

from scengen import cli


def said(capsys, *words):
    """Exit status of a command, and what it says."""
    capsys.readouterr()
    status = cli.run([str(word) for word in words])
    return status, "".join(capsys.readouterr())


@pytest.mark.parametrize("kind", ["demonstrations", "failures", "apart", "idle", "oracle"])
def test_an_honest_folder_is_sound(kind, tmp_path, capsys):
    status, text = said(capsys, "verify", f"pool={honest(kind, tmp_path / kind)}")
    assert status == 0 and ": sound: " in text


@pytest.mark.parametrize("name", DEMONSTRATIONS)
def test_a_false_claim_of_demonstrations_is_not_unsaid(name, tmp_path, capsys):
    kind, change, says = DEMONSTRATIONS[name]
    folder = honest(kind, tmp_path / "false")
    forge(change, folder)
    status, text = said(capsys, "verify", f"pool={folder}")
    assert re.search(says, text, re.S), text
    assert status or "claimed, and not checked" in text or "differs from the installed" in text


@pytest.mark.parametrize("name", RECORDINGS)
def test_a_false_claim_of_a_recording_is_not_unsaid(name, tmp_path, capsys):
    change, says = RECORDINGS[name]
    folder = honest("recording", tmp_path / "false")
    change(folder)
    _, text = said(capsys, "curate", f"data={folder}")
    assert re.search(says, text, re.S), text


@pytest.mark.parametrize("name", MIXED)
def test_a_folder_that_is_two_things_is_not_sound(name, tmp_path, capsys):
    change, says = MIXED[name]
    folder = tmp_path / "mixed"
    folder.mkdir()
    change(folder)
    words = ["curate", f"data={folder}"] if (folder / "meta").exists() else ["verify", f"pool={folder}"]
    status, text = said(capsys, *words)
    assert status and re.search(says, text, re.S), text


def test_every_command_refuses_a_pool_beside_demonstrations(tmp_path, capsys):
    folder = honest("demonstrations", tmp_path / "mixed")
    shutil.copytree(REFERENCE, folder, dirs_exist_ok=True)
    for words in (
        ["show"],
        ["evaluate", "policy=idle", "to=out"],
        ["record", "to=out"],
        ["verify"],
        ["train", "to=out"],
    ):
        given = f"{'data' if words[0] == 'train' else 'pool'}={folder}"
        status, text = said(capsys, *words, given)
        assert status == 2 and "a folder must be one of them" in text, text


def test_a_recording_of_other_demonstrations_is_not_learned_from(tmp_path, capsys):
    honest("recording", tmp_path / "policy" / "recording")
    demos = honest("demonstrations", tmp_path / "demos")
    status, text = said(capsys, "train", f"data={demos}", f"to={tmp_path / 'policy'}")
    assert status == 2 and "was recorded from other demonstrations" in text


@pytest.mark.parametrize("verb", ["demos", "evaluate", "train", "subset", "generate"])
def test_no_command_writes_into_a_thing_of_another_kind(verb, tmp_path, capsys):
    folder = honest("recording", tmp_path / "data")
    given = {
        "demos": ["task=domino_single", "n=1", f"to={folder}"],
        "generate": ["task=domino_single", "n=1", f"pool={folder}"],
        "evaluate": [f"pool={REFERENCE}", "policy=idle", f"to={folder}"],
        "train": [f"data={folder}", f"to={folder}"],
        "subset": [f"pool={REFERENCE}", "n=1", f"to={folder}"],
    }
    status, text = said(capsys, verb, *given[verb])
    assert status == 2 and "is a recording already (meta/info.json)" in text, text


def test_what_demonstrations_were_kept_apart_from_is_checked_if_it_is_given(tmp_path, capsys):
    folder = honest("apart", tmp_path / "demos")
    status, text = said(capsys, "verify", f"pool={folder}", f"apart={REFERENCE}")
    assert status == 0 and "apart from" not in text

    def false(m, rows, failures):
        m["config"]["apart"] = [REFERENCE_HASH]

    from scengen.pool import Pool

    REFERENCE_HASH = Pool.open(REFERENCE).sha256
    near = tmp_path / "near"
    assert said(capsys, "demos", "task=domino_single", "n=2", "seed=0", f"to={near}")[0] == 0
    forge(false, near)
    status, text = said(capsys, "verify", f"pool={near}", f"apart={REFERENCE}")
    assert status == 1 and "not kept apart: it is a scenario of a pool" in text
    assert "apart is for demonstrations" in said(capsys, "verify", f"pool={REFERENCE}", f"apart={REFERENCE}")[1]


def test_own_settings_of_the_checks_are_told_and_no_fault(tmp_path, capsys):
    folder = tmp_path / "own"
    given = ["task=domino_single", "n=1", "certify.overlap=0.0005", f"to={folder}"]
    assert said(capsys, "demos", *given)[0] == 0
    status, text = said(capsys, "verify", f"pool={folder}")
    assert status == 0 and "own settings of the checks" in text
