"""Cue audit: which visible quantities tell a decision of a task in training although they are not the intended ones."""
