"""Searches of cheapest paths on a grid."""
