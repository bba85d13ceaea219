"""A pool under several versions of MuJoCo: environments that differ in nothing else, and what becomes of verdicts."""
