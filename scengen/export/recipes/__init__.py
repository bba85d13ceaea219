"""Recipes: scripts that train and evaluate policies of other frameworks on a recording, in separate environments.

Every setting that decides the result is written out, so that a default which changes with a version changes nothing.
"""
