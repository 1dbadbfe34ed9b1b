"""The kernels of a first reset, compiled side by side if the cache has none."""

from pathlib import Path

from lidarium.mapping.kernels.first_start import compile_listed

LIST = Path(__file__).parent / "data" / "kernels_of_reset.json"
"""The kernels of a first reset that take long; ``scripts/dev/list_kernels.py reset`` writes it."""

_asked = False


def compile_first_reset() -> None:
    """Compile the kernels of a reset in several processes, if most are not compiled yet; checked once in a process."""
    global _asked  # once in a process
    if not _asked:
        _asked = True
        compile_listed(LIST, "the first reset")
