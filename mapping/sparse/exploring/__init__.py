"""Exploration by a depth camera: ground seen, frontiers, views, routes."""
