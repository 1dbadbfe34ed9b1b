"""Settings of the radio.

References
----------
Parameters of ``signal``: IR2 (Tan et al., "IR2: Implicit Rendezvous for Robotic Exploration Teams under
Sparse Intermittent Connectivity", IROS 2024); its pixels are taken as 0.1 m.
"""

from dataclasses import dataclass
from typing import Annotated

from lidarium.mapping.geometry.bounds import above, check_settings, share, within
from lidarium.registry import Registry

RADIO_KINDS = ("all", "none", "range", "line_of_sight", "signal")
"""Types of radio links."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioSettings:
    """Radio links between the robots of a team.

    Attributes
    ----------
    kind : str
        ``all``, ``none``, ``range`` (within ``reach``), ``line_of_sight`` (within ``reach`` and nothing solid
        between) or ``signal`` (``power`` less the path loss is above ``threshold``).
    reach : float, default 10.0
        Maximum distance for ``range`` and ``line_of_sight`` [m].
    power : float, default -20.0
        Power of the sender [dBm].
    threshold : float, default -70.0
        Power that the receiver needs [dBm].
    reference_distance : float, default 3.5
        Distance at which the loss in free space is known [m].
    reference_loss : float, default 31.0
        Loss at that distance [dB].
    free_exponent : float, default 2.0
        Growth of the loss with the path through free space [1].
    wall_exponent : float, default 4.0
        Growth of the loss with the path through solids [1].
    wall_loss : float, default 6.5
        Loss if any solid is between [dB].
    shadowing : float, default 0.0
        Standard deviation of the random loss or gain of a link, drawn at every exchange [dB].
    loss : float, default 0.0
        Probability that a message is lost [1].
    latency_s : float, default 0.0
        Time until a message arrives [s].
    period_s : float, default 1.0
        Time between exchanges of maps; poses are sent in every step [s].
    """

    kind: str = "all"
    reach: Annotated[float, above(0.0, 1e6)] = 10.0
    power: Annotated[float, within(-1000.0, 1000.0)] = -20.0
    threshold: Annotated[float, within(-1000.0, 1000.0)] = -70.0
    reference_distance: Annotated[float, above(0.0, 1e6)] = 3.5
    reference_loss: Annotated[float, within(-1000.0, 1000.0)] = 31.0
    free_exponent: Annotated[float, within(0.0, 100.0)] = 2.0
    wall_exponent: Annotated[float, within(0.0, 100.0)] = 4.0
    wall_loss: Annotated[float, within(0.0, 1e4)] = 6.5
    shadowing: Annotated[float, within(0.0, 1000.0)] = 0.0
    loss: Annotated[float, share(has_maximum=False, what="a probability")] = 0.0
    latency_s: Annotated[float, within(0.0, 1e6)] = 0.0
    period_s: Annotated[float, above(0.0, 1e6)] = 1.0

    def __post_init__(self) -> None:
        check_settings(self, "the radio")
        if self.kind not in RADIO_KINDS:
            raise ValueError(f"kind of the radio is {self.kind!r}; want one of {', '.join(RADIO_KINDS)}")

    @property
    def is_ideal(self) -> bool:
        """Whether every message reaches everybody at once."""
        return self.kind == "all" and self.loss == 0.0 and self.latency_s == 0.0


RADIO: Registry[RadioSettings] = Registry("radio")
"""Radios by name: one for each kind."""

RADIO.register("all", RadioSettings(kind="all"), "every message reaches everybody")
RADIO.register("none", RadioSettings(kind="none"), "nothing reaches anybody")
RADIO.register("range", RadioSettings(kind="range"), "reaches within a distance")
RADIO.register("line_of_sight", RadioSettings(kind="line_of_sight"), "reaches within a distance, not through walls")
RADIO.register("signal", RadioSettings(kind="signal"), "reaches as far as the signal does, weaker through walls")
