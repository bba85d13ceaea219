"""Cue audit: which visible quantities reveal a decision of a task in training although they are not the intended ones."""
