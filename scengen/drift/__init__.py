"""Comparison of a pool's verdicts under several versions of MuJoCo, in environments that differ in nothing else."""
