"""Trained explorers: features of frontiers, the network that ranks them, and its weights."""
