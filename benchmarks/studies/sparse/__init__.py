"""Sparse maps of furnished places: their quantisation, their paths beside those on grids, their size."""
