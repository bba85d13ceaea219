"""How long work is distributed to processes, logged, and written to files."""
