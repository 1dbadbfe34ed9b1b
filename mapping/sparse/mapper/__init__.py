"""Maps made of point clouds, whole or frame by frame."""
