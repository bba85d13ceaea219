"""The built-in adversary: it looks for ways to a goal around what a task is about, and knows no task."""
