"""What verification calls another task: numbers count, explanations do not."""

from copy import deepcopy

from scengen import load_task
from scengen.samplers.task import load
from scengen.validate.verify.findings import task_differences

TASK = load_task("domino_single")


def differing(**changed):
    """Keys in which the task differs from one with another axis `low_starter`."""
    node = deepcopy(dict(TASK.node))
    node["axes"]["low_starter"] |= changed
    return [found["key"] for found in task_differences(TASK, load(TASK.name, node))]


def test_reasons_and_sources_of_axes_expire_no_pool():
    assert differing() == differing(why="Another explanation.", source="elsewhere") == []


def test_values_and_severities_do():
    assert differing(replace={"starter": {"height": ["uniform", 0.05, 0.055]}}) == [
        "axes.low_starter.replace.starter.height"
    ]
    assert differing(severities=5) == ["axes.low_starter.severities"]


def test_an_axis_of_the_pool_alone_is_shown_without_reason_and_source():
    node = deepcopy(dict(TASK.node))
    node["axes"]["mine"] = {**node["axes"]["low_starter"], "why": "Mine.", "source": "here"}
    [found] = task_differences(TASK, load(TASK.name, node))
    assert (
        found["key"] == "axes.mine" and "replace" in str(found) and not {"why", "source"} & set(str(found).split("'"))
    )
