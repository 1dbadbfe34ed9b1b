"""Where modules of release 0.2 are now, for one release."""

MOVED: dict[str, str] = {}


def check_moved(name: str) -> None:
    """Raise ImportError that names the new path, if a module has moved."""
    new = MOVED.get(name.removeprefix("lidarium."))
    if new is not None:
        raise ImportError(
            f"{name} has moved to lidarium.{new}, which is internal; users import from lidarium alone, see "
            "docs/reference/api.md"
        )
