"""Suites of episodes: their settings, workers, results."""
