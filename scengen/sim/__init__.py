"""Simulation: the compiled control loop over one MuJoCo model, and the only module that knows raw addresses."""
