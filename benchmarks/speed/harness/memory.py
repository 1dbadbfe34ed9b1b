"""Memory of this process."""

from pathlib import Path


def resident() -> int | None:
    """Return how much memory of this process lies in the machine's [bytes]. None if the system does not tell."""
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        return None
    return next(int(line.split()[1]) * 1024 for line in status.splitlines() if line.startswith("VmRSS"))
