"""Sparse maps of furnished places: their quantisation, their paths besides those on grids, their size."""
