"""Training of explorers."""
