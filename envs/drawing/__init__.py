"""Frames of an environment."""
