"""A robot's own software: perception, driving, operating states."""
