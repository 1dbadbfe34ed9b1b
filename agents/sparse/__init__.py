"""Policies on sparse maps."""
