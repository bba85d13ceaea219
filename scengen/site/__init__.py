"""The static site: pages of tasks with films in three dimensions, pairs of twins, figures and the documentation."""
