"""Depth cameras on robots."""
