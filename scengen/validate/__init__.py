"""Certificates: checks, rollouts, and verification without an oracle."""
