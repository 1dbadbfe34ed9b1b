"""Explorers whose tours pass all frontiers that are left."""
