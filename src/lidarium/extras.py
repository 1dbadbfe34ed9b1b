"""How to install an extra of the installation at hand: a checkout, or a wheel."""

import importlib.util
import json
import re
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, distribution

_IN_CHECKOUT = 'pip install -c constraints.txt -e ".[{}]"'
"""Command in the folder of a checkout."""


def install_command(extra: str) -> str:
    """Return the command that installs an extra.

    In a checkout it is that of the README, in its folder. A wheel names no place that it came from, so the
    packages of the extra are listed.

    Parameters
    ----------
    extra : str
        Name of the extra, such as ``rl``.

    Examples
    --------
    >>> install_command("dxf")  # doctest: +SKIP
    "pip install 'ezdxf>=1.3'"
    """
    try:
        found = distribution("lidarium")
    except PackageNotFoundError:
        return _IN_CHECKOUT.format(extra)
    if json.loads(found.read_text("direct_url.json") or "{}").get("dir_info", {}).get("editable"):
        return _IN_CHECKOUT.format(extra)
    packages = _packages(extra, found.requires or [])
    return f"pip install {' '.join(repr(package) for package in packages)}" if packages else _IN_CHECKOUT.format(extra)


def check_installed(what: str, packages: Sequence[str], extra: str) -> None:
    """Raise ValueError if modules of an extra are missing, before work that needs them begins."""
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if missing:
        raise ValueError(f"{what} needs {', '.join(missing)}: {install_command(extra)}")


def _packages(extra: str, required: list[str]) -> list[str]:
    """Return the packages of an extra, those of extras that it contains included."""
    listed: dict[str, None] = {}
    for line in required:
        package, _, marker = (part.strip() for part in line.partition(";"))
        if not re.search(rf"""extra == ['"]{re.escape(extra)}['"]""", marker):
            continue
        inner = re.fullmatch(r"lidarium\[(.*)\]", package)
        names = [name for part in inner[1].split(",") for name in _packages(part, required)] if inner else [package]
        listed |= dict.fromkeys(names)
    return list(listed)
