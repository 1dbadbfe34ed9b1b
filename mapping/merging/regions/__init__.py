"""Regions of free space with their doors, by which maps may be joined."""
