"""Maps of walls as cubic B-splines, with corners as points.

A scan becomes points, the points of one surface a cluster, a cluster is cut at its corners, and each piece
becomes a curve; curves that run along a curve of the map improve and extend it, the others are new. All
curves have free space on the same side, the one from which they were seen: a wall seen from both sides is two
curves that run opposite ways.

References
----------
The chain of steps follows a master thesis on exploration by sensor-based random trees with B-spline features,
and Pedraza, Rodriguez-Losada, Matia, Dissanayake, Miro, "Extending the limits of feature-based SLAM with
B-splines", IEEE Trans. Robotics 25, 2009. Breakpoints: Dietmayer, Sparbert, Streller 2001; the adaptive form
by Borges, Aldon, "Line extraction in 2D range images for mobile robotics", J. Intelligent and Robotic Systems
40, 2004. Splines: de Boor, "A practical guide to splines", 1978; knots by averaging after Piegl, Tiller, "The
NURBS book", 1997, 9.4.1.
"""
