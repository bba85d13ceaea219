"""Bodies that two tasks share or that the paper ships. Each file runs alone and shows itself."""
