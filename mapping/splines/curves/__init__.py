"""B-spline curves: their basis, their fit to points, lookup along them."""
