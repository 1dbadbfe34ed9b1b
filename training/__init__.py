"""Training of explorers: from a teacher that knows the floors, then from rewards."""
