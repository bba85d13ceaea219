"""Imported before any test: scengen chooses how to draw without a display, and it must come before mujoco for that."""

import scengen  # noqa: F401
