"""Evidence about tasks: what was measured, and on which version of a task."""
