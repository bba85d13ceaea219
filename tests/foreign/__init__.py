"""A package of its own: a task and its axis outside scengen, tested by `tests/test_conformance.py`."""
