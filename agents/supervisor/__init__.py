"""A station that merges the maps of its robots, directing them by a tree of rules.

A tree of rules decides on the robots' goals and on who has finished.
"""
