"""The built-in adversary: it searches for ways to a goal that bypass the point of a task, without knowing the task."""
