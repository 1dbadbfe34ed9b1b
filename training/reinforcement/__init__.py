"""Learning from rewards, by proximal policy optimization."""
