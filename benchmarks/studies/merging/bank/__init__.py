"""A bank of partial maps that robots made, with what is true of their pairs."""
