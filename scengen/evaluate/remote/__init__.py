"""Policies that run in a separate process and are reached through a socket."""
