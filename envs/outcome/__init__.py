"""What comes of a step: the tally of an episode, the endings of robots."""
