"""Settings of quantisation."""

from dataclasses import dataclass
from typing import Annotated

from lidarium.mapping.geometry.bounds import Counted, above, check_settings

METHODS = ("kmeans++", "kmeans", "lbg")
"""How the first codes are found: drawn by squared distance, drawn evenly, or split from the mean on."""

MODES = ("default", "thesis")
"""Whether a code without points goes to the farthest point, or stays as in the thesis."""

DEVICES = ("cpu", "cuda", "auto")
"""Where Lloyd's steps run; ``auto`` takes a GPU where there is one."""

Budget = Annotated[float | None, above(0.0, 1e5)]
"""A time to spend, or None [s]."""


@dataclass(frozen=True, slots=True)
class QuantisationSettings:
    """How points are quantised.

    Attributes
    ----------
    method : str
        One of METHODS.
    steps : int
        Lloyd's steps; with LBG, after each splitting. The thesis has 7.
    seed : int
        Of the draws; the same seed gives the same bits.
    mode : str
        One of MODES.
    budget_s : float or None
        Time of the whole call that codes are moved in from where they are of least use to where the error is
        greatest [s]; such results differ with the machine. None for no such moves.
    device : str
        One of DEVICES.
    """

    method: str = "kmeans++"
    steps: Counted = 7
    seed: Counted = 0
    mode: str = "default"
    budget_s: Budget = None
    device: str = "cpu"

    def __post_init__(self) -> None:
        check_settings(self, "quantisation")
        for name, allowed in (("method", METHODS), ("mode", MODES), ("device", DEVICES)):
            if getattr(self, name) not in allowed:
                raise ValueError(
                    f"{name} of quantisation is {getattr(self, name)!r}; want one of {', '.join(allowed)}"
                )

    @property
    def keeps_empty(self) -> bool:
        """Whether codes without points stay where they are."""
        return self.mode == "thesis"
