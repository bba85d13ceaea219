"""Pictures, films, reports: everything that is looked at."""
