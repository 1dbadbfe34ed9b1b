"""Vector quantisation of point clouds."""
