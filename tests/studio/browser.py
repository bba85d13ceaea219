"""A headless Chromium that draws in software, and a gamepad in its pages that a program moves."""

import shutil

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
ARGUMENTS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""Arguments for Chromium as root and without a graphics card."""
PAD = """
window.pad = {mapping: "standard", connected: true, axes: [0, 0, 0, 0],
              buttons: Array.from({length: 17}, () => ({value: 0}))};
navigator.getGamepads = () => [window.pad];
"""
"""Script of a page with the pad."""


def installed() -> str | None:
    """Path of the browser; None for that of playwright, if there is one."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)
