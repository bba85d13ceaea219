"""Models that see and read: do they understand a scenario, plan its solution, and act on it? Graded by code."""
