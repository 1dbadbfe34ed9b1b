"""Paths on the graph of a sparse map."""
