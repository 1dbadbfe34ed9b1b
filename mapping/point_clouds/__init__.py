"""Points in space, as depth cameras and files have them."""
