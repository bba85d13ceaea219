"""Pools as environments: Gymnasium's interface over certified scenarios."""
