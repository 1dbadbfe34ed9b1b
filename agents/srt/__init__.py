"""The sensor-based random tree explorer.

It grows a tree of places with the safe region that was seen from each.
"""
