"""How fast the package is, beside other simulators.

``all`` runs every question.
"""
