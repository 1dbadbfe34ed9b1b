"""Points in space: read from files or depth images, filtered, moved between frames."""
