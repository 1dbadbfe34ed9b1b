"""The topological graph of a sparse map."""
