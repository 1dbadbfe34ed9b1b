"""Messages between robots, and the links that carry them."""
