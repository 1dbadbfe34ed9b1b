"""How time grows with the length of an episode."""
