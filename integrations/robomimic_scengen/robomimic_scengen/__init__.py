"""Checkpoints of robomimic in scengen."""
