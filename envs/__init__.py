"""Environments with the simulation below them."""
