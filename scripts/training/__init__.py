"""The command that trains explorers."""
