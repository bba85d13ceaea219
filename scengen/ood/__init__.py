"""Evidence on an OOD axis (features, memories, boundaries, cards), and a search for axes."""
