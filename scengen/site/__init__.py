"""The static site: pages of tasks with films in three dimensions, and pairs of twins."""
