"""Measurements of the costs that scengen documents, as ratios within one run."""
