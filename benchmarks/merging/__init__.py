"""How well and how fast maps are merged."""
