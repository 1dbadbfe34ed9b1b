"""A station that merges the maps of its robots and directs them.

A tree of rules decides who goes where and who has finished.
"""
