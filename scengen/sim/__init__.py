"""Simulation: the compiled control loop over one model, and the only module that knows raw addresses."""
