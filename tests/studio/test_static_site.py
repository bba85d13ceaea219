"""The static site in a real browser: films play with and without a server, sliders, search, phones, hostile texts."""

import functools
import threading
from dataclasses import replace
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
from exhibits import site_of
from helpers import REFERENCE
from hostile import PAYLOADS, corpus_texts

from scengen import load_task
from scengen.ood.analysis.redraw import task_of
from scengen.pool import Pool

pytestmark = pytest.mark.slow  # a browser that draws in software takes minutes on two cores


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    return site_of(load_task("domino_single"), tmp_path_factory.mktemp("host") / "below" / "scengen")


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


def test_search_and_sliders(opened, served):
    tab = opened(f"{served}/tasks/domino_single/index.html")
    tab.page.keyboard.press("/")
    tab.page.keyboard.type("tex")
    tab.page.keyboard.press("Enter")
    tab.page.wait_for_url("**/index.html?q=tex")
    assert "1 of 1 tasks" in tab.text() and tab.page.locator(".card").is_visible()
    tab.page.get_by_role("searchbox").fill("submarine")
    assert "no task has “submarine”" in tab.text() and not tab.page.locator(".card").is_visible()
    tab.page.goto(f"{served}/tasks/domino_single/index.html#axis-wide_gaps")
    axis = tab.page.locator("#axis-wide_gaps")
    assert axis.locator(".steps figure:visible").count() == 1 and axis.locator("output").inner_text() == "2 of 2"
    axis.locator("input[type=range]").fill("1")
    assert axis.locator(".steps figure").first.is_visible() and not axis.locator(".steps figure").last.is_visible()
    assert axis.locator("output").inner_text() == "1 of 2" and not tab.faults
    axis.locator("input[type=range]").focus()
    tab.page.keyboard.press("/")
    assert tab.page.evaluate("document.activeElement.type") == "search", "a slider takes no letters"


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
    assert len(pages) == 2 and not wide and len(grounds) == 1
    assert (grounds == {"rgb(255, 255, 255)"}) == (scheme == "light")


def test_pages_can_be_read_without_scripts(chromium, site):
    context = chromium.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto((site / "tasks/domino_single/index.html").as_uri())
    steps = page.locator("#axis-wide_gaps .steps figure")
    assert steps.count() == 2 and steps.first.is_visible() and steps.last.is_visible()
    assert not page.locator("#axis-wide_gaps .severity").is_visible()
    context.close()


@pytest.mark.parametrize("texts", [PAYLOADS, corpus_texts()], ids=["payloads", "corpus"])
def test_hostile_texts_run_no_script(opened, tmp_path, texts):
    joined = " ".join(texts)[:20_000]
    task = replace(load_task("domino_single"), instruction=joined)
    axes = {name: replace(axis, why=joined, source=joined) for name, axis in task.axes.items()}
    to = site_of(replace(task, axes=axes), tmp_path / "site", text=joined)
    for page in ("index.html", "tasks/domino_single/index.html"):
        tab = opened((to / page).as_uri())
        tab.page.wait_for_timeout(1000)
        assert tab.page.evaluate("window.hacked") is None and not tab.faults
        assert next(text for text in texts if text.isascii() and text.isprintable())[:10] in tab.text()
        assert (
            tab.page.locator("script").count() == 1
            and not tab.page.locator("main svg, main style, main iframe").count()
        )


def test_the_player_loads_recordings_of_the_site_alone(opened, site):
    asked = []
    for film in (
        "../../evil",
        "https://evil.example/x",
        "domino_single/film-1.js/../../x",
        '"><img src=x onerror=hacked=1>',
    ):
        tab = opened("about:blank")
        tab.page.on("request", lambda request: asked.append(request.url))
        tab.page.goto(f"{(site / 'player.html').as_uri()}?film={film}", wait_until="commit")
        tab.page.get_by_text("This page plays the films").wait_for()
        assert tab.page.evaluate("window.hacked") is None
    assert len([url for url in asked if url.startswith(("file:", "http"))]) == 4


@pytest.fixture(scope="module")
def filmed(site):
    """The site with the film of a witness."""
    from scengen.site.exhibit import _clip

    pool = Pool.open(REFERENCE)
    _clip(task_of(pool), pool.at(0), "witness", site / "tasks" / "domino_single", "film-1")
    return site


@pytest.mark.parametrize("served_by", ["host", "file"])
def test_a_film_plays_with_and_without_a_server_and_nothing_is_fetched_from_elsewhere(
    opened, filmed, served, served_by
):
    base = served if served_by == "host" else filmed.as_uri()
    tab = opened("about:blank")
    asked = []
    tab.page.on("request", lambda request: asked.append(request.url))
    tab.page.goto(f"{base}/tasks/domino_single/index.html")
    tab.page.locator(".clip").first.click()
    film = tab.page.frame_locator(".stage iframe")
    film.locator("canvas").first.wait_for()
    clock = film.locator("input").first
    clock.wait_for()
    tab.wait(lambda: float(clock.input_value()) > 0.2, "a film that plays")
    assert len(asked) > 5 and not [url for url in asked if not url.startswith((base, "data:", "blob:"))]
    assert not tab.faults
