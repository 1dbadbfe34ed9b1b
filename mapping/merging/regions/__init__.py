"""Regions of free space, the doors between them, and motions under which those of two maps meet."""
