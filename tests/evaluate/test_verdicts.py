"""Verdicts of two harnesses: a scenario that is missing or ends otherwise is named."""

import helpers

from scengen.evaluate.verdicts import compared, replay_verdicts
from scengen.pool import Pool


def test_every_scenario_of_a_pool_has_a_verdict():
    verdicts = replay_verdicts([str(helpers.REFERENCE)])
    assert set(verdicts) == {row.id for row in Pool.open(helpers.REFERENCE).rows(witness=False)}


def test_what_differs_or_is_missing_is_named():
    ours = {"a": True, "b": False, "c": True}
    assert compared(ours, ours) == ("3 scenarios: 2 solved in scengen, 0 verdicts differ", True)
    line, same = compared({"a": True, "b": True}, ours)
    assert not same and line.endswith("2 verdicts differ: b, c")
