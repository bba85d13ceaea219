"""A separate package: a task and its axis outside scengen, tested by `tests/test_conformance.py`."""
