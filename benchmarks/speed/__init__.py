"""How fast the package is, besides other simulators. ``all`` runs every question."""
