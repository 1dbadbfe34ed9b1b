"""The measurements of what is not plane: depth images with bodies in contact."""
