"""Bounds: the fastest exploration by a team that knows the floor."""
