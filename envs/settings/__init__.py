"""Settings of an environment."""
