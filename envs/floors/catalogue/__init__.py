"""Floors by name."""
