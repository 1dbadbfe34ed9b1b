"""The study of learned explorers."""
