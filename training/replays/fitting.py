"""Fits a network to samples of replays: options that would have saved time are preferred more."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from lidarium.agents.learned.features import OPTION_FEATURES, TEAMMATE_FEATURES
from lidarium.training.decisions import Decisions
from lidarium.training.replays.samples import Samples, joined
from lidarium.training.settings import FitSettings
from lidarium.training.torch_network import ExplorerNetwork, Seen

_MIRRORED_OPTION = tuple(list(OPTION_FEATURES).index(name) for name in ("left",))
_MIRRORED_TEAMMATE = tuple(list(TEAMMATE_FEATURES).index(name) for name in ("left", "sine", "target_left"))


@dataclass(frozen=True, slots=True)
class Fit:
    """How a fit went on.

    Attributes
    ----------
    fitted, held_out : float
        Loss on what is fitted and on what is not: the expected loss of time, -1 to 1; 0 where no other option
        is ever taken.
    """

    fitted: float
    held_out: float


def losses_of(samples: Samples, full_share: float) -> NDArray[np.float32]:
    """Return what each replay lost, from -1 (much time saved) to 1, (N,) float32."""
    change = (samples.replayed[:, -1] - samples.times[:, -1]) / (full_share * samples.times[:, -1])
    return np.clip(change, -1.0, 1.0).astype(np.float32)


def fit(network: ExplorerNetwork, floors: list[Samples], settings: FitSettings, seed: int) -> Iterator[Fit]:
    """Fit a network to the samples of some floors; at the end it is as it was in its best epoch.

    Parameters
    ----------
    network : ExplorerNetwork
        Changed in place.
    floors : list of Samples
        Floor by floor.
    settings : FitSettings
        How.
    seed : int
        Of the order, and of what is held out.

    Yields
    ------
    Fit
        How each epoch went.

    Raises
    ------
    ValueError
        Where there are not two floors.
    """
    if len(floors) < 2:
        raise ValueError(f"there are replays of {len(floors)} floors; want 2 at least: one is held out")
    generator = np.random.default_rng(seed)
    order = generator.permutation(len(floors))
    count = min(max(round(settings.held_out * len(floors)), 1), len(floors) - 1)
    held_out = joined([floors[k] for k in order[:count]])
    fitted = joined([floors[k] for k in order[count:]])
    optimizer = torch.optim.AdamW(
        network.parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay
    )
    best, least = network.weights(), evaluate(network, held_out, settings)
    for _ in range(settings.epochs):
        loss = _epoch(network, fitted, settings, optimizer, generator)
        found = Fit(loss, evaluate(network, held_out, settings))
        if found.held_out < least:
            best, least = network.weights(), found.held_out
        yield found
    network.set_weights(best)


def evaluate(network: ExplorerNetwork, samples: Samples, settings: FitSettings) -> float:
    """Return the mean loss of taking the preferred one of the two options of each sample."""
    losses = losses_of(samples, settings.full_share)
    gaps = []
    with torch.no_grad():
        for start in range(0, len(samples), 1024):
            rows = np.arange(start, min(start + 1024, len(samples)))
            gaps.append(_gaps(network, samples, rows, is_mirrored=False)[0].numpy())
    return float(np.where(np.concatenate(gaps) > 0.0, losses, 0.0).mean())


def _epoch(
    network: ExplorerNetwork,
    samples: Samples,
    settings: FitSettings,
    optimizer: torch.optim.Optimizer,
    generator: np.random.Generator,
) -> float:
    """See all samples once, half of them mirrored; return the mean loss."""
    losses = torch.from_numpy(losses_of(samples, settings.full_share))
    order, total = generator.permutation(len(samples)), 0.0
    for start in range(0, len(order), settings.batch):
        rows = order[start : start + settings.batch]
        gaps, corrections = _gaps(network, samples, rows, is_mirrored=bool(generator.random() < 0.5))
        loss = (torch.sigmoid(gaps) * losses[rows]).mean()
        optimizer.zero_grad()
        (loss + settings.correction_cost * corrections).backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        total += loss.item() * len(rows)
    return total / len(order)


def _gaps(
    network: ExplorerNetwork, samples: Samples, rows: NDArray[np.int64], *, is_mirrored: bool
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return by how much each replay's option is preferred, and the mean square of the corrections."""
    decisions = samples.decisions.take(rows)
    seen = Seen(mirrored(decisions) if is_mirrored else decisions)
    preferences, _ = network(seen)
    at = torch.arange(len(rows))
    gaps = preferences[at, samples.other[rows]] - preferences[at, samples.chosen[rows]]
    corrections = (preferences - network.steepness * seen.scores)[seen.mask].square().mean()
    return gaps, corrections


def mirrored(decisions: Decisions) -> Decisions:
    """Return decisions with left and right exchanged."""
    options, teammates = decisions.options.copy(), decisions.teammates.copy()
    options[..., _MIRRORED_OPTION] *= -1.0
    teammates[..., _MIRRORED_TEAMMATE] *= -1.0
    crops = np.ascontiguousarray(decisions.crops[..., ::-1])
    return replace(decisions, options=options, teammates=teammates, crops=crops)
