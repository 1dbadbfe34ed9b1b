"""Training of the teams of the zoo, by rewards alone."""
