"""Pictures and films of scenarios, and tables for reports."""
