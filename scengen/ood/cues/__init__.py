"""Cue audit: visible quantities that reveal a decision of a task although they are not the intended ones."""
