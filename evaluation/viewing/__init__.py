"""Live view of a run in a browser: scene, page, controls, pace."""
