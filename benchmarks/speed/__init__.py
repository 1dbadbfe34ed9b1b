"""How fast the package is, beside other simulators, and how its speed grows.

``all`` runs every question.
"""
