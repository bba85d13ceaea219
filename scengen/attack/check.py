"""The adversary as a check of a certificate: a few rollouts that need nothing but the scenario and its witness."""

from ..validate.certify import Finding, Trial
from .adversary import RANDOM, SEARCH, Attack
from .evidence import spelled
from .player import Player
from .retries import RETRY
from .variations import WITNESS

TIERS = (RETRY, WITNESS, RANDOM, SEARCH)
"""Shortcuts have a check of their own; fixed answers and foreign witnesses need other scenarios of the task."""


def attacked(trial: Trial) -> Finding:
    """Attack the scenario of a trial with as many rollouts as its settings ask for; the draws depend on its id alone.

    Returns:
        The settings, how many rollouts of each tier reached the goal, and the first way around what the task is about.
    """
    assert trial.witness is not None
    player = Player(trial.scenario, trial.text, trial.embodiment, trial.horizon, trial.witness.actions)
    result = Attack(player, seed=0).run(trial.settings.attack, TIERS)
    numbers = {
        f"{rate.tier}_{spelled(rate.raw)}": {"rollouts": rate.rollouts, "hits": rate.hits} for rate in result.rates
    }
    around = next((hit for hit in result.hits if hit.refutes), None)
    reason = f"a way around, {around}" if around else ""
    return {"rollouts": trial.settings.attack}, numbers, reason
