"""Paths on occupancy grids, from clearance to the targets of exploration."""
