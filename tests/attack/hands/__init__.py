"""Cheats found by hand: a file for each task, with `HANDS`, cheats by name."""
