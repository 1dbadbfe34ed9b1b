"""Files of sparse maps."""
