"""What happens before the first episode of a new installation."""
