"""Policies that run in a process of their own and are reached through a socket."""
