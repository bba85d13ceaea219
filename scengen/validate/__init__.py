"""Certificates: checks, rollouts, verification without any oracle."""
