"""Policies that drive to frontiers of the occupancy map."""
