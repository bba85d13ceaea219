"""Moves that oracles and shortcuts are made of, one arm at a time."""
