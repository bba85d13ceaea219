"""Environments over pools of certified scenarios: Gymnasium's and robosuite's interfaces."""
