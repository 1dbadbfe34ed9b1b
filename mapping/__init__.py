"""Maps with what is computed on them; knows nothing of environments.

Grids are indexed ``(row, column)`` with row 0 at the lowest y; ``origin`` is the lower left corner of cell
(0, 0) in metres and ``resolution`` the side of a cell in metres. Everywhere else the order is ``(x, y)``.
"""
