"""Driving in a real browser: a scripted gamepad solves a scenario, a lost browser pauses, strangers cannot drive."""

import asyncio
import base64
import contextlib
import io
import json
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("viser", reason="no viser; it is in the extra studio")

import websockets.exceptions
import websockets.sync.client
from browser import PAD
from helpers import REFERENCE
from pads import Domino
from studios import running

from scengen import cli, compose, load_task
from scengen.cli.commands.demos_pad import source_of_pool
from scengen.demos.teleop.collect import Source, TeleopSettings
from scengen.demos.teleop.eye import POLICY_CAMERA
from scengen.demos.teleop.pad import PadEvent
from scengen.demos.teleop.session import ENDED, PAUSED, READY
from scengen.envs.observations import cameras_of
from scengen.look.looks import ROOM
from scengen.pictures.render import Camera
from scengen.pool import Pool
from scengen.pool.demonstrations import Demonstrations
from scengen.pool.untrusted import Malformed
from scengen.studio.app import Content
from scengen.studio.driving import PICTURE, BrowserPad, Driver, _event

BUTTONS = ["a", "b", "x", "y", "leftshoulder", "rightshoulder", "lefttrigger", "righttrigger", "back", "start"]
AXES = ["leftx", "lefty", "rightx", "righty"]


def content_of(folder, n=1):
    pool = Pool.open(REFERENCE)
    settings = TeleopSettings(device="browser", n=n, operator="op3", to=str(folder))
    return Content(shelf=None, driver=Driver(source_of_pool(pool, (), None), settings))


def wait_for(condition, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it does not come to that"
        time.sleep(0.05)


@pytest.mark.parametrize(
    "message",
    ["", "[]", '["leftx"]', '["leftx", 2]', '["lefx", 0.5]', '["leftx", "1"]', '["a", 0.5]', '["a", true]', "[" * 90,
     '["leftx", NaN]', '["leftx", 0.5' + " " * 100 + "]", '{"leftx": 1}'],
)  # fmt: skip
def test_a_message_that_is_no_event_is_refused(message):
    with pytest.raises((Malformed, Exception)) as refused:
        _event(message)
    assert not isinstance(refused.value, (RecursionError, MemoryError))


def test_the_first_browser_plugs_the_pad_in_and_the_last_one_out():
    pad = BrowserPad()
    pad.begin()
    assert pad.read(None) == [PadEvent("connected", 0.0)]

    class Connection:
        async def __aiter__(self):
            yield '["leftx", 0.5]'
            yield '["a", 1]'

    with ThreadPoolExecutor(1) as thread:  # an open browser keeps the loop of this thread running
        thread.submit(asyncio.run, pad.serve(Connection())).result()
    events = pad.read(None)
    assert events[:3] == [PadEvent("connected", 1.0), PadEvent("leftx", 0.5), PadEvent("a", 1.0)]
    assert PadEvent("leftx", 0.0) in events and events[-1] == PadEvent("connected", 0.0)


def test_pads_over_the_websocket_drive_and_a_lost_one_pauses(tmp_path):
    with running(content_of(tmp_path / "driven")) as studio:
        driver = studio.content.driver
        port = studio.server.get_port()
        wait_for(lambda: driver.session is not None)
        assert not len(driver.session.actions)
        address, origin = f"ws://127.0.0.1:{port}/{studio.token}/pad", f"http://127.0.0.1:{port}"
        with websockets.sync.client.connect(address, origin=origin) as pad:
            wait_for(lambda: driver.session.pad["connected"])
            if driver.session.phase != READY:
                for value in (1, 0):
                    pad.send(json.dumps(["start", value]))
            pad.send(json.dumps(["lefty", -1]))
            wait_for(lambda: len(driver.session.actions) > 30)
        wait_for(lambda: driver.session.phase == PAUSED)
        assert "unplugged" in driver.session.message
        for path in ("/pad", f"/{studio.token[:-1]}/pad"):
            with pytest.raises(websockets.exceptions.InvalidStatus):
                websockets.sync.client.connect(f"ws://127.0.0.1:{port}{path}", origin=origin)
        with websockets.sync.client.connect(address, origin=origin) as stranger:
            stranger.send('["leftx", 7]')
            with pytest.raises(websockets.exceptions.ConnectionClosed):
                stranger.recv(timeout=20)
    assert not len(Demonstrations.open(tmp_path / "driven"))


@pytest.mark.slow
def test_a_scripted_gamepad_in_the_browser_solves_a_scenario(chromium, opened, tmp_path):
    """The program sees the state line alone, and its events go through the Gamepad API of the page."""
    folder = tmp_path / "driven"
    with running(content_of(folder)) as studio:
        driver = studio.content.driver
        tab = opened(studio.address, PAD, (400, 300))  # small pictures leave the time to drive
        page = tab.page
        page.wait_for_selector(".studio-line")
        tab.wait(lambda: bool(driver.session.pad["connected"]), "a pad")
        page.screenshot(path=str(tmp_path / "drive.png"))
        program, session, seen = Domino(), driver.session, -1
        while not solved(driver):
            if driver.session is not session:
                program, session, seen = Domino(), driver.session, -1
            if session.phase == PAUSED:
                press(page, "start")
            elif session.ticks == seen:
                page.wait_for_timeout(5)  # a program acts once in a control period
            elif (events := program.read(session.line)) is not None:
                seen = session.ticks
                for event in events:
                    put(page, event)
            elif session.phase == ENDED:
                page.screenshot(path=str(tmp_path / "ended.png"))
                press(page, "start")
            else:
                page.wait_for_timeout(50)
        assert not tab.faults
    assert cli.run(["verify", f"pool={folder}"]) == 0
    (row,) = Demonstrations.open(folder).rows()
    assert row.outcome == "success" and Demonstrations.open(folder).manifest.operator == "op3"


def test_a_page_shows_the_picture_that_a_policy_sees_where_it_is_turned(chromium, opened, tmp_path):
    settings = TeleopSettings(device="browser", n=1, to=str(tmp_path / "driven"))
    task = load_task("mirror_pick_place")
    source = Source.of_task(task, compose.certify_levels(task)["quick"], settings)
    with running(Content(shelf=None, driver=Driver(source, settings))) as studio:
        tab = opened(studio.address, PAD, (800, 600))
        tab.page.wait_for_selector(".studio-line")
        tab.wait(lambda: shown_picture(tab.page) is not None and shown_picture(tab.page).std() > 10, "a picture")
        shown = shown_picture(tab.page)
        stage = studio.content.driver.session.stage
    with contextlib.closing(Camera(stage.world(ROOM), *PICTURE)) as camera:
        plain = camera.take(cameras_of(stage.embodiment)[POLICY_CAMERA]).astype(float)
    seen = stage.scenario.orientation.apply(plain)
    assert np.abs(shown - seen).mean() < 5 < np.abs(shown - plain).mean()


PIXELS = """image => {
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
    canvas.getContext("2d").drawImage(image, 0, 0);
    return canvas.toDataURL("image/png").split(",")[1];
}"""


def shown_picture(page):
    """The picture in the panel; None before the first one."""
    image = page.locator("img[src^='blob:']").first
    if not image.count():
        return None
    with Image.open(io.BytesIO(base64.b64decode(image.evaluate(PIXELS)))) as picture:
        return np.asarray(picture.convert("RGB"), float)


def solved(driver):
    return any("success" in line for line in driver.told)


def put(page, event):
    if event.control in AXES:
        page.evaluate(f"window.pad.axes[{AXES.index(event.control)}] = {event.value}")
    elif event.control in BUTTONS:
        page.evaluate(f"window.pad.buttons[{BUTTONS.index(event.control)}].value = {event.value}")


def press(page, control):
    for value in (1.0, 0.0):
        put(page, PadEvent(control, value))
        page.wait_for_timeout(60)
