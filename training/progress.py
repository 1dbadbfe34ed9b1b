"""Progress of a training."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a part of a training has come.

    Attributes
    ----------
    part : str
        Name of the part.
    done, total : int
        How much of it, and of how much.
    figures : mapping of float
        Text about the latest step.
    """

    part: str
    done: int
    total: int
    figures: Mapping[str, float] = field(default_factory=dict)
