"""Sampling: keyed random numbers, distributions, designs, OOD axes and task files."""
