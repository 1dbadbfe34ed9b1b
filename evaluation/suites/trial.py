"""A single episode of a suite."""

import hashlib
from dataclasses import dataclass

DEFAULT_VARIANT = "default"


@dataclass(frozen=True, slots=True, order=True)
class Trial:
    """One episode of a suite.

    Attributes
    ----------
    variant : str
        Name of the settings.
    floor : str
        Name of the floor, as for ``load_floor``.
    robots : int
        Size of the team.
    start : int
        Which of the suite's starts on this floor, -1 if the seed draws them.
    seed : int
        Seed of all draws.
    policy : str
        Name of the policy.
    """

    variant: str
    floor: str
    robots: int
    start: int
    seed: int
    policy: str

    @property
    def key(self) -> str:
        """The trial in one line; no other trial has the same."""
        start = "" if self.start < 0 else f" start {self.start}"
        return f"{self.variant} | {self.floor} | {self.robots} | seed {self.seed}{start} | {self.policy}"

    @property
    def file_name(self) -> str:
        """The key as the stem of a file's name: readable, and no other trial's."""
        letters = "".join(
            letter if letter.isalnum() or letter in "._-" else "-"
            for letter in self.key.replace(" | ", "__").replace(" ", "")
        )
        return f"{letters[-150:]}-{hashlib.sha256(self.key.encode('utf-8', 'surrogatepass')).hexdigest()[:8]}"
