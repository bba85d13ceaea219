"""Sheets of all tasks that state facts, and facts of draws without a certificate."""

from functools import cache

from scengen import load_task
from scengen.agents import facts
from scengen.certificate import Check
from scengen.params import parameters
from scengen.samplers.task_files import facts_file, tasks

STATED = [name for name in tasks() if facts_file(name)]
"""Tasks that state facts."""


@cache
def drawn(name, split, index):
    """Sheet, scenario and facts of a draw, with a certificate in which each shortcut broke a rule."""
    task = load_task(name)
    sheet, scenario = facts.load(task), task.draw(split, 0, index).scenario
    return sheet, scenario, sheet.facts_of(task, task_params(scenario), (shortcuts_check(scenario),))


def task_params(scenario):
    """Values of the parameters of a scenario, as a pool holds them."""
    return {p.name: p.nominal for p in parameters(scenario)}


def shortcuts_check(scenario):
    """The check of shortcuts as a certificate records it."""
    outcome = {"filtered": {"outcome": "failure", "reason": "a rule was broken", "seconds": 1.0}}
    return Check("shortcuts", True, "", {}, dict.fromkeys(scenario.shortcuts(), outcome))
