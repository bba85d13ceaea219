"""Statistics of pools and distributions: distances, coverage, selection bias, smallest causes of a failure."""
