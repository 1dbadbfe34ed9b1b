"""Settings of the training of a network that predicts maps: the table ``[prediction]`` of a TOML file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from lidarium.envs.floors.generation.buildings import KINDS
from lidarium.mapping.geometry.bounds import above, check_settings, share, shown, within

DUNGEON = "dungeon"
"""Kind of the floors of rooms and tunnels that are drawn for this training."""

PLAN = "plan"
"""Kind of the floors that are variants of given ones."""

MAP_KINDS = (*KINDS, DUNGEON, PLAN)
"""Kinds of floors to learn from."""

SHIPPED = "shipped"
"""Network to begin with that is the package's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictionSettings:
    """How a network that predicts maps is trained.

    Attributes
    ----------
    seed : int, default 0
        Seed of all draws.
    floors : int, default 3000
        Number of floors that robots explore; each gives several partial maps.
    maps : int, default 8
        Partial maps of a floor.
    kinds : dict of float
        How often each kind of floor comes, besides the others.
    plans : tuple of str, default ()
        Names or files of the floors whose variants are of the kind "plan"; two at least.
    begin : str, default ""
        Network to begin with: a file of weights, "shipped" for that of the package, or "" for none.
    bare_share, noisy_share : float, default 0.35, 0.3
        Share of the buildings and plans without furniture, and share of the runs with noisy lasers.
    floors_minutes, fit_minutes : float, default 0.0
        Exploring and fitting end after so long, over all interrupted calls; 0 for no limit. With a limit the
        result depends on the speed of the machine.
    steps : int, default 20000
        Steps of gradients.
    batch : int, default 128
        Windows of a step.
    learning_rate, weight_decay : float, default 0.001, 0.01
        Of AdamW; the rate falls to 0 as a half cosine.
    held_out : float, default 0.05
        Share of the floors that judge the network and are not fitted.
    far_weight : float, default 0.3
        Weight of unknown squares more than 3 m from what is known, besides nearer ones.
    checkpoint : int, default 250
        Steps from one checkpoint to the next.
    """

    seed: Annotated[int, within(0, 2**31 - 1)] = 0
    floors: Annotated[int, within(2, 9_000)] = 3000
    maps: Annotated[int, within(1, 100)] = 8
    kinds: Mapping[str, float] = field(
        default_factory=lambda: {"apartment": 0.4, "office": 0.25, "corridors": 0.15, DUNGEON: 0.2}
    )
    plans: tuple[str, ...] = ()
    begin: str = ""
    bare_share: Annotated[float, share()] = 0.35
    noisy_share: Annotated[float, share()] = 0.3
    floors_minutes: Annotated[float, within(0.0, 10_000.0)] = 0.0
    fit_minutes: Annotated[float, within(0.0, 10_000.0)] = 0.0
    steps: Annotated[int, within(1, 10_000_000)] = 20_000
    batch: Annotated[int, within(1, 100_000)] = 128
    learning_rate: Annotated[float, above(0.0, 1.0)] = 1e-3
    weight_decay: Annotated[float, within(0.0, 10.0)] = 0.01
    held_out: Annotated[float, share(has_minimum=False, has_maximum=False)] = 0.05
    far_weight: Annotated[float, share()] = 0.3
    checkpoint: Annotated[int, within(1, 10_000_000)] = 250

    def __post_init__(self) -> None:
        check_settings(self, "prediction")
        for kind, often in self.kinds.items():
            if kind not in MAP_KINDS:
                raise ValueError(f"kinds has {shown(kind)}; want some of {', '.join(MAP_KINDS)}")
            if isinstance(often, bool) or not isinstance(often, int | float) or not 0.0 <= often <= 1e6:
                raise ValueError(f"kinds.{kind} is {shown(often)}; want a number of 0 or more")
        if not sum(self.kinds.values()) > 0.0:
            raise ValueError(f"kinds is {shown(dict(self.kinds))}; want at least one above 0")
        if self.kinds.get(PLAN, 0.0) > 0.0 and len(set(self.plans)) < 2:
            raise ValueError(f"plans is {shown(self.plans)}, and kinds has {PLAN!r}; want two floors at least")
        if self.begin not in ("", SHIPPED) and not Path(self.begin).is_file():
            raise ValueError(f"begin is {shown(self.begin)}; want {SHIPPED!r}, a file of weights, or nothing")
