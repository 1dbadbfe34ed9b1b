"""Simultaneous localization with a graph of submaps."""
