"""What scengen and shells write is read back: paths are taken as they are, whatever letters are in them."""

import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen import cli, compose
from scengen.pool import Pool
from scengen.samplers.task_files import search_path

AWKWARD = ["many/domino_single-id-seed=0", "my pools/id", "[1]", "~draft", "ünï", "a\rb", "it's", 'so "called"', "a\\"]
REFERENCE = "generated/reference/domino_single-id"


def read(verb, text, *more):
    """The value of a setting as a command reads it."""
    return compose.composed(verb, [text, *more])[0][text.partition("=")[0]]


@settings(max_examples=30, deadline=None)
@given(st.text(min_size=1).filter(lambda text: "${" not in text and "," not in text and not text.startswith("~")))
def test_every_text_is_a_path(text):
    if compose.HYDRAS.fullmatch(text) or set(text) & {"\0"}:
        return
    assert read("show", f"to={text}", "pool=there") == text


@pytest.mark.parametrize("name", AWKWARD)
def test_a_pool_is_found_by_its_path_in_any_folder(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(Path(__file__).parents[2] / REFERENCE, tmp_path / name)
    assert cli.run(["show", f"pool={name}"]) == 0
    assert cli.run(["show", f"pool={name},{name}"]) == 0
    one = next(iter(Pool.open(tmp_path / name).names()))
    assert cli.run(["show", f"pool={name}", f"id={one}"]) == 0 and not capsys.readouterr().err


def test_a_comma_belongs_to_a_name_that_exists(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x=[uniform,0,1]").mkdir()
    assert read("show", "pool=x=[uniform,0,1]") == "x=[uniform,0,1]"
    assert read("show", "pool=one,x=[uniform,0,1],two") == ["one", "x=[uniform,0,1]", "two"]
    assert read("show", "pool=[one,two]") == read("show", "pool=one,two") == ["one", "two"]


def test_home_and_names_of_the_command_line_stand_in_paths(monkeypatch):
    monkeypatch.setenv("HOME", "/home/me")
    assert read("show", "to=~/x", "pool=there") == "/home/me/x"
    assert read("generate", "pool=made/${task}-${split}", "task=packing", "split=tight") == "made/packing-tight"
    made = compose.combinations("generate", ["pool=made/${task}", "task=packing,cube_toss", "n=3"])
    assert [compose.composed("generate", one.overrides)[0]["pool"] for one in made] == [
        "made/packing",
        "made/cube_toss",
    ]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["generate", "domino_single"], "did you mean task=domino_single?"),
        (["show", REFERENCE], f"did you mean pool={REFERENCE}?"),
        (["generate", "nothing"], "see scengen generate --help"),
        (["generate", "task=packing", "task.id.x=a=b"], "quote the value twice: 'task.id.x=\"a=b\"'"),
    ],
)
def test_what_is_no_override_is_told_what_it_may_have_been(capsys, words, told):
    assert cli.run(words) == 2
    shown = capsys.readouterr().err
    assert told in shown and "spaces or commas" not in shown


def test_search_paths_are_paths(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    whole = f"hydra.searchpath=['file://{tmp_path}/my conf']"
    for spelled in (
        "my conf",
        "[my conf]",
        f"{tmp_path}/my conf",
        f"'file://{tmp_path}/my conf'",
        f'["{tmp_path}/my conf"]',
    ):
        assert search_path([f"hydra.searchpath={spelled}"]) == (whole,), spelled
    assert search_path(["hydra.searchpath=pkg://theirs.conf,here"]) == (
        f"hydra.searchpath=['pkg://theirs.conf','file://{tmp_path}/here']",
    )


def test_what_a_shell_completes_is_what_the_command_reads():
    words = ["bash", "-c", "printf %s pool=my\\ pools/a\\=1"]
    quoted = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert read("show", quoted) == "my pools/a=1"
