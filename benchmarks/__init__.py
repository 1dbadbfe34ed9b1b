"""Measurements of speed, studies of quality."""
