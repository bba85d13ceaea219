"""Evidence on an OOD axis: features, replayed actions, boundaries, cards."""
