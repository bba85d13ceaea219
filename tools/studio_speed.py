"""Measure the studio in headless Chromium, which draws in software: `python tools/studio_speed.py [POOL]`

Printed are the time from the address to the first words about a scenario, and, while a stick moves the robot at 640 x
480, the pictures that the browser draws in a second and the times of the control loop.
"""

import os
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

from browser import ARGUMENTS, PAD, installed
from playwright.sync_api import Page, sync_playwright

from scengen.cli.commands.demos_pad import source_of_pool
from scengen.demos.teleop.collect import TeleopSettings
from scengen.ood.analysis.redraw import task_of
from scengen.pool import Pool
from scengen.samplers.task_files import search_path
from scengen.studio.app import Content, Studio
from scengen.studio.browse import Shelf
from scengen.studio.driving import Driver

HOST = "127.0.0.1"
SIZE = (640, 480)
"""Size of the page [pixels]."""
DURATION = 10.0
"""Duration of driving [s]."""
OPENINGS = 5
"""How often the page is opened."""
COUNTER = "window.drawn = 0; (function next() { window.drawn++; requestAnimationFrame(next); })();"
"""Counts the pictures that the browser draws."""


def openings(pool: Pool, page: Page) -> list[float]:
    """Times from the address to the first words about a scenario [s]."""
    found = []
    shelf = Shelf([pool], {str(pool.folder): task_of(pool, search_path(()))})
    with closing(Studio(Content(shelf), HOST, 0)) as studio:
        for _ in range(OPENINGS):
            begun = time.perf_counter()
            page.goto(studio.address)
            page.get_by_text("certificate").first.wait_for(timeout=60_000)
            found.append(time.perf_counter() - begun)
            page.goto("about:blank")
    return found


def driven(pool: Pool, page: Page, folder: Path) -> tuple[float, str]:
    """Pictures per second while the robot moves, and the times of the control loop as text."""
    settings = TeleopSettings(device="browser", n=1, to=str(folder))
    driver = Driver(source_of_pool(pool, (), None), settings)
    with closing(Studio(Content(None, driver=driver), HOST, 0)) as studio:
        page.goto(studio.address)
        page.wait_for_selector(".studio-line", timeout=60_000)
        page.wait_for_timeout(3000)
        _press(page, 9)  # start
        page.evaluate(COUNTER)
        begun = time.perf_counter()
        while (now := time.perf_counter()) < begun + DURATION:
            page.evaluate(f"window.pad.axes[0] = {0.5 if int(now - begun) % 2 else -0.5}")
            page.wait_for_timeout(500)
        drawn = page.evaluate("window.drawn") / (time.perf_counter() - begun)
        told = driver.timing.told()
        _press(page, 8)  # back
    return drawn, told


def _press(page: Page, button: int) -> None:
    for value in (1, 0):
        page.evaluate(f"window.pad.buttons[{button}].value = {value}")
        page.wait_for_timeout(100)


def main(pool: str = "generated/reference") -> None:
    """Measure and print."""
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    with sync_playwright() as player, tempfile.TemporaryDirectory() as folder:
        browser = player.chromium.launch(executable_path=installed(), args=ARGUMENTS)
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
        page.add_init_script(PAD)
        opened = Pool.open(pool).check()
        first, *others = openings(opened, page)
        print(
            f"first words after {first:.2f} s, then {sorted(others)[len(others) // 2]:.2f} s (median of {len(others)})"
        )
        drawn, told = driven(opened, page, Path(folder, "driven"))
        print(f"{drawn:.1f} pictures a second at {SIZE[0]} x {SIZE[1]}; {told}")
        browser.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
