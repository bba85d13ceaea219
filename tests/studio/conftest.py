"""A headless Chromium. Tests are skipped only where there is no browser."""

import importlib.util

import pytest
from browser import ARGUMENTS, installed

PATIENCE = 120_000
"""Longest wait for the page [ms]: two cores draw it in software, beside other work."""


@pytest.fixture(scope="session")
def chromium():
    for package in ("viser", "playwright"):
        if importlib.util.find_spec(package) is None:
            pytest.skip(f"no {package}; it is in the extras studio and dev")
    from playwright.sync_api import Error, sync_playwright

    with sync_playwright() as player:
        found = installed()
        try:
            browser = player.chromium.launch(executable_path=found, args=ARGUMENTS)
        except Error:
            if found is not None:
                raise
            pytest.skip("no Chromium on this machine")
        yield browser
        browser.close()


class Tab:
    """A page of the studio, with everything that its scripts have complained about."""

    def __init__(self, page):
        self.page, self.faults = page, []
        page.set_default_timeout(PATIENCE)
        page.on("pageerror", lambda error: self.faults.append(str(error)))
        page.on("dialog", lambda dialog: (self.faults.append("a dialog"), dialog.dismiss()))

    def time(self):
        """Time of the film that the slider shows [s]."""
        return float(self.page.locator("[role=slider]").first.get_attribute("aria-valuenow") or 0)

    def press(self, button):
        self.page.get_by_role("button", name=button, exact=True).click()

    def wait(self, condition, what, *arguments):
        """Wait until a condition on this tab holds."""
        for _ in range(PATIENCE // 200):
            if condition(*arguments):
                return
            self.page.wait_for_timeout(200)
        raise AssertionError(f"the page does not come to {what}")

    def rested(self):
        """Whether the film stands still: updates that are on their way have arrived."""
        before = self.time()
        self.page.wait_for_timeout(1500)
        return self.time() == before

    def text(self):
        return self.page.locator("body").inner_text()


@pytest.fixture
def opened(chromium):
    """A function that opens the page of a studio in a new tab."""
    pages = []

    def of(address, script="", size=(1280, 800)):
        page = chromium.new_page(viewport={"width": size[0], "height": size[1]})
        page.add_init_script(script)
        pages.append(page)
        tab = Tab(page)
        page.goto(address)
        return tab

    yield of
    for page in pages:
        page.close()
