"""Long runs: generation of pools, their journals, progress."""
