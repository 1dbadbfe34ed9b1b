"""What robots send each other, with the links that carry it."""
