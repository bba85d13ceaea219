"""Policies on pools: rollouts, rates with intervals, how many rollouts are enough."""
