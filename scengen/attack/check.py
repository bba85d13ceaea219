"""The adversary as a check of a certificate: a few rollouts that need only the scenario and its witness."""

from ..validate.certify import Finding, Trial
from .adversary import RANDOM, SEARCH, Attack
from .evidence import spelled
from .player import Player
from .retries import RETRY
from .servo import SERVO
from .variations import WITNESS

TIERS = (SERVO, RETRY, WITNESS, RANDOM, SEARCH)
"""Tiers of the check. Shortcuts have a separate check. Fixed answers, memories and foreign witnesses need other
scenarios, and a certificate depends on its own scenario alone."""


def attacked(trial: Trial) -> Finding:
    """Attack the scenario of a trial. The number of rollouts is a setting; random draws depend on the id alone.

    Returns:
        The settings, the numbers of rollouts and hits of each tier, and the first hit that bypasses the task.
    """
    assert trial.solution is not None
    player = Player(trial.scenario, trial.text, trial.embodiment, trial.horizon, trial.solution.actions)
    result = Attack(player, seed=0).run(trial.settings.attack, TIERS)
    numbers = {
        f"{rate.tier}_{spelled(rate.raw)}": {"rollouts": rate.rollouts, "hits": rate.hits} for rate in result.rates
    }
    around = next((hit for hit in result.hits if hit.refutes), None)
    reason = f"a way around, {around}" if around else ""
    return {"rollouts": trial.settings.attack}, numbers, reason
