"""The study of what evaluations cost, with what survives killed ones."""
