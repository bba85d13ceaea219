"""Verification of pools by their claims alone, without an oracle."""
