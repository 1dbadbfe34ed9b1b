"""Memory of this process."""

from pathlib import Path


def resident() -> int | None:
    """Return the resident memory of this process [bytes], or None if the system does not report it."""
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        return None
    return next(int(line.split()[1]) * 1024 for line in status.splitlines() if line.startswith("VmRSS"))
