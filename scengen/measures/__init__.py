"""Measurements that fill the evidence ledger, and the tables that show what the ledger holds about a task."""
