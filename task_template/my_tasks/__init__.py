"""Tasks for scengen."""
