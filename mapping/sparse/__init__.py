"""Sparse maps of point clouds, from codes to paths."""
