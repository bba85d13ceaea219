"""Moves, rollouts, certificates, and their verification without any oracle."""
