"""A station that merges the maps of its robots, and decides by a tree of rules who goes where and who has done his work."""
