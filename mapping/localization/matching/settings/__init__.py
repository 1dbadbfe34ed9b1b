"""Settings of localization."""
