"""Simulation: scenes as text, worlds that run them, and their memory."""
