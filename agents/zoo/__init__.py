"""Zoo: teams that were trained by rewards, run by numpy."""
