"""Commands of sparse maps."""
