"""A policy has at least a quarter more time than a person needs on average."""

import re

import pytest

from scengen import list_tasks
from scengen.samplers import task_files

MEAN = re.compile(r"^horizon: *([0-9.]+) *#.*takes ([0-9.]+) s [(]paper", re.M)
"""A time limit, and the mean demonstration of the paper beside it [s]."""
LIMITS = {
    task: tuple(map(float, found.groups()))
    for task in list_tasks()
    if (found := MEAN.search((task_files.conf_dir() / "task" / f"{task}.yaml").read_text()))
}


def test_the_paper_gives_a_mean_for_every_task():
    assert {task for task in list_tasks() if task_files.category(task) != "X"} == set(LIMITS)


@pytest.mark.parametrize("task", LIMITS)
def test_the_time_limit_is_at_least_a_quarter_longer_than_the_mean_demonstration(task):
    limit, mean = LIMITS[task]
    assert limit >= 1.25 * mean
