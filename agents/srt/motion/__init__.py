"""How one robot of the tree moves."""
