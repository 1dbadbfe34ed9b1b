"""Joins occupancy maps of robots that know nothing of each other's start.

A map is an array of three levels (0 occupied, 127 unknown, 255 free), row 0 at the lowest y. Within this
package its frame has the origin at the lower left corner of cell (0, 0) and axes along columns and rows, in
metres; `Transform` named ``a_from_b`` maps points of map b into map a.

References
----------
The corner detector, its polar descriptor and the disc test follow a master thesis on map merging for teams of
robots; if its printed rules are kept beside ours, ``mode="thesis"`` chooses them. Corner maps aligned by
polar descriptors: Blanco, Gonzalez-Jimenez, Fernandez-Madrigal, "A robust, multi-hypothesis approach to
matching occupancy grid maps", Robotica 31, 2013. Agreement of overlaid maps as acceptance: Birk, Carpin,
"Merging occupancy grid maps from multiple robots", Proc. IEEE 94, 2006.
"""
