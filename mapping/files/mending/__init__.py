"""Mends what files of other programs say wrongly."""
