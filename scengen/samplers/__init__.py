"""Distributions, keyed random streams, and what leads from a task file to scenario number i."""
