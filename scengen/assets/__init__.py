"""Bodies that two tasks share or that the paper specifies. Run a file on its own to view its asset."""
