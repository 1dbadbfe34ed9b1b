"""What robots sense beside their laser, as settings say it."""
