"""Training of the network that predicts maps."""
