"""All kinds of measurements, by name."""

from collections.abc import Mapping

from .adversary import Attacks, LeakSearches
from .axes import Beliefs, Cards
from .control import Controls
from .disturbed import Disturbed
from .measurement import Measurement
from .perturbations import Proofs
from .policies import Baselines, Trainings
from .scenarios import Certified, Drift
from .understanding import Plans, Priors

MEASUREMENTS: Mapping[str, type[Measurement]] = {
    one.KIND: one
    for one in (
        Certified,
        Cards,
        Beliefs,
        Attacks,
        LeakSearches,
        Drift,
        Plans,
        Priors,
        Baselines,
        Trainings,
        Proofs,
        Controls,
        Disturbed,
    )
}
"""Measurements by the kind of their rows. Rows of other kinds come from tools of the repository."""
