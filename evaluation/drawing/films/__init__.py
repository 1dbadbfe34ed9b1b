"""Films: what they show, how their frames become a file."""
