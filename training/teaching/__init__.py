"""Learning from a teacher that knows the floor."""
