"""Floors: solids in metres, importers, generator, catalogue."""
