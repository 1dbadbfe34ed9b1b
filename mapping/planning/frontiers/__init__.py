"""Frontiers of a map: their cells, clusters, views, and the places from which a body sees them."""
