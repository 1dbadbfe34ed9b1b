"""Bodies, lasers and noise, over arrays of episodes and robots."""
