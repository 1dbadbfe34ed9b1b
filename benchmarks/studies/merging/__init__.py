"""The quality of map merging on a bank of partial maps.

Robots made the maps; it holds what is true of their pairs, and the methods tried on them.
"""
