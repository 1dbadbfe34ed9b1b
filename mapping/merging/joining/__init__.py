"""Maps joined by what was accepted of their pairs."""
