"""Distribution of work to processes and Ray clusters, logs of long runs, and output files."""
