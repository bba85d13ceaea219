"""Distributions, keyed random streams, and the way from a task file to scenario number i."""
