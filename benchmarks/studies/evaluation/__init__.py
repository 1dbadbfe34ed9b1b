"""The study of what evaluations cost, and of what survives killed ones."""
