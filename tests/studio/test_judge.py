"""Judging in a real browser: scores and verdicts are in the tables at once, and survive a reload and a second tab."""

import csv
import json
import shutil
import threading
from pathlib import Path

import pytest
from studios import running

from scengen import cli
from scengen.cli.commands.settings import read_task
from scengen.demos.curate.curation import decided_again
from scengen.demos.curate.people import Decision, decisions_of_people, scores_by_people, write_decision, write_score
from scengen.demos.generate import DemosSettings, generate_demonstrations
from scengen.errors import BadConfig, PoolError, UnknownName
from scengen.export.dataset import Recording


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    settings, task, checks = read_task("demos", ["task=domino_single", "n=4", f"to={folder / 'demos'}"], DemosSettings)
    generate_demonstrations(task, checks, settings, lambda *_: None)
    assert cli.run(["record", f"pool={folder / 'demos'}", f"to={folder / 'data'}", "cameras=none"]) == 0
    assert cli.run(["curate", f"data={folder / 'data'}", "replay=false"]) == 0
    return folder / "data"


@pytest.fixture
def mine(recorded, tmp_path):
    return Path(shutil.copytree(recorded, tmp_path / "data"))


def table(folder, name):
    with open(folder / "curation" / name, newline="") as file:
        return list(csv.DictReader(file))


def kept(folder):
    return json.loads((folder / "curation" / "kept.json").read_text())


# --- tables -------------------------------------------------------------------------------------


def test_a_score_and_a_verdict_are_written_in_place_of_earlier_ones_and_decide(mine):
    tables = mine / "curation"
    assert kept(mine) == [0, 1, 2, 3]
    write_score(tables, 2, 2, 4)
    write_score(tables, 0, 5, 4)
    write_score(tables, 2, 3, 4)
    write_decision(tables, 1, Decision("reject", "p1", 'slips, says "no"; <b>'), 4)
    assert table(mine, "scores.csv") == [{"episode": "0", "score": "5"}, {"episode": "2", "score": "3"}]
    assert scores_by_people(tables / "scores.csv", 4) == {0: 5, 2: 3}
    assert decisions_of_people(tables / "decisions.csv", 4)[1].why == 'slips, says "no"; <b>'
    again = decided_again(Recording.open(mine))
    assert again.kept == (0, 3) and kept(mine) == [0, 3]
    assert again.reports[2].scored_by == "person" and again.reports[2].score == 3


@pytest.mark.parametrize(
    ("write", "error", "says"),
    [
        (lambda t: write_score(t, 0, 6, 4), BadConfig, "score = 6; it must be 1 to 5"),
        (lambda t: write_score(t, 4, 5, 4), BadConfig, "episode = 4; it must be 0 to 3"),
        (lambda t: write_decision(t, 0, Decision("maybe", "", ""), 4), UnknownName, "no verdict named 'maybe'"),
        (lambda t: write_decision(t, 0, Decision("accept", "", "a\nb"), 4), BadConfig, "give one line of at most 500"),
        (lambda t: write_decision(t, 0, Decision("accept", "", "x" * 501), 4), BadConfig, "give one line of at most"),
    ],
)
def test_what_has_no_meaning_is_not_written(mine, write, error, says):
    with pytest.raises(error, match=says):
        write(mine / "curation")
    assert not (mine / "curation" / "scores.csv").exists() and not (mine / "curation" / "decisions.csv").exists()


def test_a_table_that_cannot_be_read_is_not_overwritten(mine):
    path = mine / "curation" / "scores.csv"
    path.write_text("episode,score\n0,good\nnobody,5\n")
    with pytest.raises(BadConfig, match="line 3: episode = 'nobody'"):
        write_score(mine / "curation", 1, 5, 4)
    assert "good" in path.read_text()


def test_writers_at_the_same_time_lose_nothing(mine):
    tables = mine / "curation"
    threads = [threading.Thread(target=write_score, args=(tables, k % 4, 1 + k % 5, 4)) for k in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(scores_by_people(tables / "scores.csv", 4)) == [0, 1, 2, 3]


@pytest.mark.parametrize("text", ["{", "[]", '{"episode": 0}', ""])
def test_reports_that_are_damaged_or_of_another_recording_are_refused(mine, text):
    (mine / "curation" / "reports.jsonl").write_text(text + "\n" if text else "")
    with pytest.raises(PoolError, match="run scengen curate"):
        decided_again(Recording.open(mine))


# --- in the browser -----------------------------------------------------------------------------


@pytest.mark.slow
def test_three_episodes_are_judged_by_buttons_and_keys(chromium, opened, mine, tmp_path):
    from scengen.studio.app import Content, Desk

    with running(Content(shelf=None, desk=Desk([Recording.open(mine)]))) as studio:
        tab = opened(studio.address)
        page = tab.page
        page.get_by_text("episode 0: domino_single").wait_for()
        page.get_by_text("replayed: success at").wait_for()
        page.screenshot(path=str(tmp_path / "judge.png"))
        tab.press("2")
        page.get_by_text("(person)").wait_for()
        assert table(mine, "scores.csv") == [{"episode": "0", "score": "2"}] and kept(mine) == [1, 2, 3]
        tab.press("next episode")
        page.get_by_text("episode 1: domino_single").wait_for()
        page.mouse.click(300, 700)
        page.keyboard.press("r")
        page.get_by_text("decided:").wait_for()
        tab.wait(lambda: kept(mine) == [2, 3], "a rejected episode")
        page.reload()
        page.get_by_text("episode 0: domino_single").wait_for()
        assert "(person)" in tab.text()
        other = opened(studio.address)
        other.page.get_by_text("episode 0: domino_single").wait_for()
        other.press("accept")
        other.page.get_by_text("decided:").wait_for()
        assert [row["verdict"] for row in table(mine, "decisions.csv")] == ["accept", "reject"]
        assert kept(mine) == [0, 2, 3]
        assert not tab.faults and not other.faults
    assert {path.name for path in mine.iterdir()} == {"data", "meta", "curation", "README.md"} - (
        set() if (mine / "README.md").exists() else {"README.md"}
    )
