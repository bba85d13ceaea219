"""Pools in the formats of others: plain MJCF, LeRobot data sets."""
