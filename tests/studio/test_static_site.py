"""The static site in a real browser: films play with and without a server, sliders, search, phones, hostile pools."""

import functools
import shutil
import threading
from dataclasses import replace
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from helpers import REFERENCE, pictures_are_possible
from hostile import PAYLOADS, corpus_texts
from pools import rewritten

from scengen.analysis.redraw import task_of
from scengen.pool import Pool

pytestmark = pytest.mark.slow  # a browser that draws in software takes minutes on two cores
ROOT = Path(__file__).parents[2]


def built(pool, to, docs=None):
    """The site of a pool. Of its axes two are shown, which saves a minute."""
    from scengen.site.build import Shown, build

    task = task_of(pool)
    few = replace(task, axes={name: task.axes[name] for name in ("diagonal", "wide_gaps")})
    result = build([Shown(few, [pool])], to, docs)
    assert not result.failed
    return to


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    if not pictures_are_possible():
        pytest.skip("no OpenGL")
    return built(Pool.open(REFERENCE), tmp_path_factory.mktemp("host") / "below" / "scengen", ROOT)


@pytest.fixture
def served(site):
    """Address of the site below a path of a host."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    host = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(site.parents[1])))
    threading.Thread(target=host.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{host.server_address[1]}/below/scengen"
    host.shutdown()


def played(tab):
    """Choose the first film, and wait until it plays."""
    tab.page.locator(".clip").first.click()
    film = tab.page.frame_locator(".stage iframe")
    film.locator("canvas").first.wait_for()
    clock = film.locator("input").first
    clock.wait_for()
    tab.wait(lambda: float(clock.input_value()) > 0.2, "a film that plays")
    return film


@pytest.mark.parametrize("served_by", ["host", "file"])
def test_a_film_plays_with_and_without_a_server_and_nothing_is_fetched_from_elsewhere(opened, site, served, served_by):
    base = served if served_by == "host" else site.as_uri()
    tab = opened("about:blank")
    asked = []
    tab.page.on("request", lambda request: asked.append(request.url))
    tab.page.goto(f"{base}/tasks/domino_single/index.html")
    assert "success at" in tab.text() and "failure at" in tab.text()
    played(tab)
    assert len(asked) > 5 and not [url for url in asked if not url.startswith((base, "data:", "blob:"))]
    assert not tab.faults


def test_search_and_sliders(opened, served):
    tab = opened(f"{served}/docs/index.html")
    field = tab.page.get_by_role("searchbox")
    tab.page.keyboard.press("/")
    field.type("tile jaw")
    field.press("Enter")
    tab.page.wait_for_url("**/index.html?q=*")
    assert "1 of 1 tasks" in tab.text() and tab.page.locator(".card").is_visible()
    tab.page.get_by_role("searchbox").fill("submarine")
    assert "no task has “submarine”" in tab.text() and not tab.page.locator(".card").is_visible()
    tab.page.goto(f"{served}/tasks/domino_single/index.html#axis-wide_gaps")
    axis = tab.page.locator("#axis-wide_gaps")
    assert axis.locator(".steps figure:visible").inner_text().startswith("wide_gaps@5")
    axis.locator("input[type=range]").fill("2")
    assert axis.locator(".steps figure:visible").inner_text().startswith("wide_gaps@2")
    assert "2 of 5" in axis.locator("output").inner_text() and not tab.faults
    assert not tab.page.locator("#axis-diagonal input[type=range]").count()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pages_fit_a_phone_in_light_and_dark(opened, site, scheme):
    tab = opened("about:blank", size=(360, 740))
    tab.page.emulate_media(color_scheme=scheme)
    pages = [page for page in site.rglob("*.html") if page.name != "player.html"]
    wide, grounds = [], set()
    for page in pages:
        tab.page.goto(page.as_uri())
        if tab.page.evaluate("document.documentElement.scrollWidth") > 360:
            wide.append(str(page.relative_to(site)))
        grounds.add(tab.page.evaluate("getComputedStyle(document.body).backgroundColor"))
    assert len(pages) > 40 and not wide and len(grounds) == 1
    assert (grounds == {"rgb(255, 255, 255)"}) == (scheme == "light")


def test_pages_can_be_read_without_scripts(chromium, site):
    page = chromium.new_context(java_script_enabled=False).new_page()
    page.goto((site / "tasks/domino_single/index.html").as_uri())
    assert page.locator("#axis-wide_gaps .steps figure").count() == 5
    assert page.locator("#axis-wide_gaps .steps figure").last.is_visible()
    assert not page.locator(".severity").first.is_visible()
    page.context.close()


@pytest.mark.parametrize("texts", [PAYLOADS, corpus_texts()], ids=["payloads", "corpus"])
def test_a_hostile_pool_runs_no_script(opened, tmp_path, texts):
    if not pictures_are_possible():
        pytest.skip("no OpenGL")
    folder = Path(shutil.copytree(REFERENCE, tmp_path / "hostile"))
    joined = " ".join(texts)[:20_000]

    def change(row):
        checks = tuple(replace(check, reason=joined[:900]) for check in row.certificate.checks)
        return replace(row, instruction=joined, certificate=replace(row.certificate, checks=checks))

    rewritten(folder, change)
    pool = Pool.open(folder)
    node = {**pool.manifest.task_node, "instruction": joined}
    axes = {name: {**axis, "why": joined, "source": joined} for name, axis in node["axes"].items()}
    hostile = replace(pool.manifest, task_node={**node, "axes": axes})
    hostile.write(folder)
    to = built(Pool.open(folder), tmp_path / "site")
    for page in ("index.html", "tasks/domino_single/index.html"):
        tab = opened((to / page).as_uri())
        tab.page.wait_for_timeout(2000)
        assert tab.page.evaluate("window.hacked") is None and not tab.faults
        assert tab.page.get_by_text(texts[0][:20]).first.is_visible()
        assert (
            tab.page.locator("script").count() == 1
            and not tab.page.locator("main svg, main style, main iframe").count()
        )


def test_the_player_loads_recordings_of_the_site_alone(opened, site):
    for film in (
        "../../evil",
        "https://evil.example/x",
        "domino_single/film-1.js/../../../x",
        '"><img src=x onerror=hacked=1>',
    ):
        tab = opened("about:blank")
        asked = []
        tab.page.on("request", lambda request, asked=asked: asked.append(request.url))
        tab.page.goto(f"{(site / 'player.html').as_uri()}?film={film}")
        tab.page.wait_for_timeout(500)
        assert len([url for url in asked if url.startswith(("file:", "http"))]) == 1
        assert tab.page.evaluate("window.hacked") is None
