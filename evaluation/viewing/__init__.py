"""A run shown in a browser while it goes: scene, page, controls, pace."""
