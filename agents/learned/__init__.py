"""Trained explorers: what a network sees of frontiers, how it ranks them, if its weights are."""
