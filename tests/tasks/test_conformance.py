"""Every task keeps to the rules, on every split; `make slow` also certifies the first training scenario of each.

`make certify` certifies scenarios of all splits; the rules themselves are tested in `test_foreign_task.py`.
"""

import pytest

from scengen import conformance, list_tasks

CHECKS = [
    pytest.param(check, id=f"{task}-{check}")
    for task in list_tasks()
    for check in conformance.checks(task, scenarios=1, certified=("id",))
]


@pytest.mark.parametrize("check", CHECKS)
def test_our_tasks_keep_to_the_rules(check):
    check()
