"""Explorers that were trained: what they see, and how they prefer one frontier to another."""
