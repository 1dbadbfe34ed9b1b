"""What the station knows of its robots."""
