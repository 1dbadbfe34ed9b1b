"""Trained explorers: what a network sees of frontiers, how it ranks them, where its weights are."""
