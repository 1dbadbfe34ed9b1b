"""What commands leave of their results, on the screen or in files."""
