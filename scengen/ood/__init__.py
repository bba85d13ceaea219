"""Out of distribution: what an axis is, and the proof that it leaves the training support."""
