"""Pairs of maps with few corners, joined by corners or by regions of free space."""
