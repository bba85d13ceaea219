"""Curation of recordings in three stages: scores, checks of every episode, decisions of people."""
