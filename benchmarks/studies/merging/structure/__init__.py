"""What proposes transforms: corners beside regions of free space and the doors between them."""
