"""Tours of teams past the frontiers of a map."""
