"""Occupancy grids: their cells, their updates by scans, crops of them."""
