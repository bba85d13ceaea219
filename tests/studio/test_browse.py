"""Browsing in a real browser: scenarios, twins, films; a hostile pool shows its texts and runs nothing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import REFERENCE
from hostile import PAYLOADS, corpus_texts
from pools import make, rewritten
from studios import running

from scengen.envs.gym import PoolEnv
from scengen.ood.analysis.redraw import task_of
from scengen.pool import Pool

pytestmark = pytest.mark.slow  # a browser that draws in software takes minutes on two cores


def content_of(*folders):
    from scengen.studio.app import Content
    from scengen.studio.browse import Shelf

    pools = [Pool.open(folder).check() for folder in folders]
    return Content(Shelf(pools, {str(pool.folder): task_of(pool) for pool in pools}))


@pytest.fixture(scope="module")
def shifted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pool") / "wide"
    make(folder, "split=wide_gaps", n=2)
    return folder


def test_browse_play_scrub_find_and_see_the_twin(chromium, opened, shifted, tmp_path):
    with running(content_of(REFERENCE, shifted)) as studio:
        tab = opened(studio.address)
        page = tab.page
        page.wait_for_selector(".studio-scenario")
        first, *_, last = Pool.open(REFERENCE).names()
        assert str(first) in tab.text() and "a scenario of training: nothing was moved" in tab.text()
        assert f"scengen try task=domino_single split=id seed=0 index={first.index}" in tab.text()
        page.get_by_text("witness: success at").wait_for()
        tab.press("play")
        tab.wait(lambda: tab.time() > 0.3, "a film that plays")
        tab.press("pause")
        tab.wait(tab.rested, "a film that stands")
        assert 0 < tab.time() < 5
        tab.press("start")
        tab.wait(lambda: tab.time() == 0, "the start")
        page.locator("[role=slider]").first.focus()
        for _ in range(5):
            page.keyboard.press("ArrowRight")
        tab.wait(lambda: abs(tab.time() - 0.2) < 1e-6, "a time that was scrubbed to")
        (client,) = studio.server.get_clients().values()
        browser = studio._pages[client.client_id].browser
        browser._find.value = last.id
        page.get_by_text(str(last)).first.wait_for()
        browser._find.value = "nothing-like-it"
        page.locator(".studio-fault").get_by_text("nothing-like-it").wait_for()
        assert str(last) in tab.text() and "jittered runs succeed" in tab.text(), "the page stays"
        browser._pool.value = browser._pool.options[1]
        page.get_by_text("moved out of training").wait_for()
        assert "tile" in tab.text() or "gap" in tab.text()
        assert "(training" in tab.text()
        tab.wait(lambda: browser._label is not None, "a training twin")
        assert len(browser._twin._frames) < len(browser._view._frames)  # a twin has no robot
        page.wait_for_timeout(3000)
        assert not page.locator("#webgl-software-rendering").is_visible()
        page.screenshot(path=str(tmp_path / "browse.png"))
        page.set_viewport_size({"width": 375, "height": 800})
        scene, panel = page.locator("canvas").first, page.get_by_text("scengen studio", exact=True)
        tab.wait(lambda: 300 < scene.bounding_box()["height"] < 400, "a phone's layout")
        assert page.evaluate("document.documentElement.scrollWidth") == 375
        assert panel.bounding_box()["y"] >= scene.bounding_box()["height"] > 300
        page.set_viewport_size({"width": 1280, "height": 800})
        browser._what.value = browser._what.options[1]
        browser._run(browser._play)
        page.get_by_text(f"{browser._what.value}: ").wait_for()
        assert not tab.faults


def test_a_slider_shows_the_scene_under_every_level_of_a_perturbation(chromium, opened, tmp_path):
    with running(content_of(REFERENCE)) as studio:
        tab = opened(studio.address, size=(1280, 1200))
        page = tab.page
        page.get_by_text("witness: success at").wait_for()
        (client,) = studio.server.get_clients().values()
        seen = studio._pages[client.client_id].browser.seen

        def choose(label, option):
            page.get_by_label(label, exact=True).last.click()
            page.get_by_role("option", name=option, exact=True).click()

        assert not seen.image.visible, "nothing is drawn before it is asked for"
        choose("perturbation", "clean")
        tab.wait(lambda: seen.image.visible, "a clean picture")
        clean = seen.image.image.copy()
        choose("perturbation", "light_colour")
        page.get_by_text("light_colour@3: ").wait_for()
        third = seen.image.image.copy()
        page.locator("[role=slider]").nth(1).focus()
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowRight")
        page.get_by_text("light_colour@5: ").wait_for()
        fifth = seen.image.image
        away = [np.abs(each.astype(int) - clean).mean() for each in (third, fifth)]
        assert 2 < away[0] < away[1]
        page.screenshot(path=str(tmp_path / "seen.png"))
        env = PoolEnv("domino_single", REFERENCE, "rgb_exo_right_cam", perturb="light_colour@5")
        assert (env.reset(seed=0)[0]["rgb_exo_right_cam"] == fifth).all(), "as in the environment"
        env.close()
        choose("perturbation", "wrist_camera")
        page.get_by_text("affects wrist cameras, and none is observed").wait_for()
        choose("camera", "rgb_gripper_cam")
        page.get_by_text("wrist_camera@5: ").wait_for()
        choose("perturbation", "foreign")
        page.get_by_text("推倒第一块").wait_for()
        tab.press("next")
        page.get_by_text(str([*Pool.open(REFERENCE).names()][1])).first.wait_for()
        tab.wait(lambda: seen._drawn[0] == Pool.open(REFERENCE).at(1).id, "the next scenario")
        assert not tab.faults


def test_two_tabs_look_at_different_scenarios_and_a_reload_starts_again(chromium, opened):
    with running(content_of(REFERENCE)) as studio:
        one, other = opened(studio.address), opened(studio.address)
        names = [str(name) for name in Pool.open(REFERENCE).names()]
        for tab in (one, other):
            tab.page.get_by_text(names[0]).first.wait_for()
        other.press("next")
        other.page.get_by_text(names[1]).first.wait_for()
        assert names[1] not in one.text() and names[0] in one.text()
        studio.server._websock_server.disconnect_all_clients()  # a lost connection: the pages come back by themselves
        for tab in (one, other):
            tab.page.get_by_text(names[0]).first.wait_for()
        one.page.reload()
        one.page.get_by_text(names[0]).first.wait_for()
        assert not one.faults and not other.faults


@pytest.mark.parametrize("texts", [PAYLOADS, corpus_texts()], ids=["payloads", "corpus"])
def test_a_hostile_pool_runs_no_script(chromium, opened, tmp_path, texts):
    import shutil

    folder = Path(shutil.copytree(REFERENCE, tmp_path / "hostile"))
    joined = " ".join(texts)[:20_000]

    def change(row):
        checks = tuple(replace(check, reason=joined[:900]) for check in row.certificate.checks)
        scene = row.scene_xml
        for number, text in enumerate(texts[:6]):
            name = text.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;").replace("\x1b", "")
            scene = scene.replace(f'"tile_{number}"', f'"{name}"')
        certificate = replace(row.certificate, checks=checks)
        return replace(row, instruction=joined, certificate=certificate, scene_xml=scene)

    rewritten(folder, change)
    with running(content_of(folder)) as studio:
        tab = opened(studio.address)
        tab.page.wait_for_selector(".studio-scenario, .studio-fault")
        tab.page.wait_for_timeout(4000)
        assert tab.page.evaluate("window.hacked") is None and not tab.faults
        shown = tab.page.locator(".studio-fault, .studio-scenario").first
        assert shown.is_visible()
        assert not tab.page.locator(".studio-scenario img, .studio-scenario script, .studio-scenario iframe").count()
        assert not tab.page.locator(".studio-scenario svg, .studio-scenario a, .studio-scenario style").count()
        tab.page.screenshot(path=str(tmp_path / "hostile.png"))


def test_the_negative_control_of_the_payloads(chromium):
    """The same texts run in a page that does not escape them."""
    page = chromium.new_page()
    page.set_content(f"<html><body>{PAYLOADS[1]}</body></html>")
    page.wait_for_timeout(500)
    assert page.evaluate("window.hacked") == 1
    page.close()
