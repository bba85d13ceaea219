"""Evaluation of policies on pools: rollouts, rates with intervals, statistical power."""
