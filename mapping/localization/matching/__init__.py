"""Poses from scans matched with maps."""
