"""Graphs of poses, closed by loops."""
