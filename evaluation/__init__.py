"""Metrics, the runner and the records of episodes."""
