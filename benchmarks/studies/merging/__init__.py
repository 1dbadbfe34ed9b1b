"""How well maps are merged: a bank of partial maps that robots made, what is true of their pairs, and the methods tried on them."""
