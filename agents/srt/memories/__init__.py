"""What a robot of the tree remembers of the space around it."""
