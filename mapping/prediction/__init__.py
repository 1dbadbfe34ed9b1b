"""Predicted maps: which unknown cells of a partial map are probably free."""
