"""Pages of tasks: what was made is kept, what has changed is made again, what fails is told; texts stay texts."""

import json
import re
from dataclasses import asdict, replace
from html import escape

import numpy as np
import pytest

pytest.importorskip("viser", reason="no viser; it is in the extras studio and dev")

from exhibits import made, site_of
from hostile import PAYLOADS

from scengen import cli, load_task
from scengen.errors import BadConfig, PoolError
from scengen.site import build as building
from scengen.site import exhibit
from scengen.site.build import Shown, build


@pytest.fixture
def makes(monkeypatch):
    """The tasks whose films and pictures would have been made."""
    asked = []

    def make(task, rows, folder, key, progress):
        asked.append(task.name)
        if task.name == "packing":
            raise PoolError("it cannot be played")
        folder.mkdir(parents=True, exist_ok=True)
        (folder / exhibit.DESCRIPTION).write_text(json.dumps(asdict(made(task, key))))

    monkeypatch.setattr(building.exhibit, "make", make)
    return asked


def test_only_what_has_changed_is_made_again_and_earlier_tasks_stay(tmp_path, makes):
    domino, rod = Shown(load_task("domino_single")), Shown(load_task("rod_across"))
    assert build([domino], tmp_path).made == ["domino_single"]
    assert build([domino, rod], tmp_path).kept == ["domino_single"] and makes == ["domino_single", "rod_across"]
    changed = Shown(load_task("domino_single", ["task.horizon=20"]))
    assert build([changed], tmp_path).made == ["domino_single"]
    index = (tmp_path / "index.html").read_text()
    assert "tasks/domino_single/index.html" in index and "tasks/rod_across/index.html" in index
    (tmp_path / "tasks/rod_across" / exhibit.DESCRIPTION).write_text('{"key": 1')  # a run that was ended
    assert build([rod], tmp_path).made == ["rod_across"]


def test_a_task_that_cannot_be_shown_is_told_and_the_others_are_written(tmp_path, makes):
    built = build([Shown(load_task("packing")), Shown(load_task("domino_single"))], tmp_path)
    assert built.failed == {"packing": "it cannot be played"} and built.made == ["domino_single"]
    assert "tasks/packing" not in (tmp_path / "index.html").read_text()


def test_a_task_without_a_certified_scenario_is_refused_with_the_reason(tmp_path):
    never = load_task("domino_single", ["task.horizon=0.02"])
    with pytest.raises(exhibit.ScengenError, match="none of 20 training scenarios is certified"):
        exhibit._certified(never)


@pytest.mark.parametrize("payload", PAYLOADS)
def test_texts_of_pools_and_tasks_stay_texts(tmp_path, monkeypatch, payload):
    task = replace(load_task("domino_single"), instruction=payload)
    task = replace(task, axes={name: replace(axis, why=payload, source=payload) for name, axis in task.axes.items()})
    folder = tmp_path / "tasks/domino_single"
    folder.mkdir(parents=True)
    shown = Shown(task)
    (folder / exhibit.DESCRIPTION).write_text(json.dumps(asdict(made(task, shown.key, payload))))
    assert build([shown], tmp_path).kept == ["domino_single"]
    for page in (tmp_path / "index.html", folder / "index.html"):
        text = page.read_text()
        assert payload not in text or payload == escape(payload)
        assert str(escape(payload, quote=False)).split("&")[0] in text.replace("&#39;", "'").replace("&#34;", '"')


def test_every_link_within_the_site_leads_somewhere(tmp_path):
    """Wherever the folder lies, also below a path of a host; nothing is fetched from elsewhere."""
    site = site_of(load_task("domino_single"), tmp_path / "site")
    pages = [page for page in site.rglob("*.html") if page.name != "player.html"]
    anchors = {page: set(re.findall(r' id="([^"]+)"', page.read_text())) for page in pages}
    wrong = []
    for page in pages:
        text = page.read_text()
        assert not re.findall(r'<(?:script|img|iframe|link)[^>]+(?:src|href)="(?:https?:)?//', text), page
        for link in re.findall(r'(?:href|src|action)="([^"]*)"', text):
            path, _, part = link.partition("?")[0].partition("#")
            target = (page.parent / path).resolve() if path else page
            known = link.startswith("data:") or (target.exists() and part in {"", *anchors.get(target, [part])})
            wrong += [] if known else [(page.name, link)]
    assert len(pages) == 2 and not wrong


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["task=domino_single", "pool=generated/reference/domino_single-id"], "give either task=NAME"),
        (["task=domino_singl"], "did you mean 'domino_single'"),
        (["pool=nowhere"], "nowhere"),
        (["task=domino_single", "to=README.md"], "is a file; name a folder"),
    ],
)
def test_bad_settings_end_in_one_line(arguments, says, capsys, tmp_path):
    to = [] if any(word.startswith("to=") for word in arguments) else [f"to={tmp_path}"]
    assert cli.run(["site", *arguments, *to]) == 2
    told = capsys.readouterr().err
    assert says in told and told.count("\n") == 1


def test_pictures_that_differ_in_a_small_place_do_not_look_alike():
    one = np.full((300, 400, 3), 100, np.uint8)
    hole, noise = one.copy(), one.copy()
    hole[10:16, 10:16, 2] = 200
    noise += np.random.default_rng(0).integers(0, 5, noise.shape, np.uint8)
    assert exhibit.alike(one, noise) and not exhibit.alike(one, hole)


def test_a_full_disk_ends_the_run(tmp_path, monkeypatch):
    def make(*_):
        raise BadConfig("no space")

    monkeypatch.setattr(building.exhibit, "make", make)
    with pytest.raises(BadConfig, match="no space"):
        build([Shown(load_task("domino_single"))], tmp_path)
