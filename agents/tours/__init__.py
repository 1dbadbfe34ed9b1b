"""Explorers with tours past all frontiers that are left."""
