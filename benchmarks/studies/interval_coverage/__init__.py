"""The study of how often intervals hold a known truth."""
