"""Statistics of pools and distributions: distances, coverage, selection bias, causes of a failure."""
