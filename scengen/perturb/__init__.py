"""Perturbations: shifts of what a policy perceives, which leave the physics as it is."""
