"""Floors with teams on them, for measurements of speed."""
