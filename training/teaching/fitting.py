"""Fits a network to lessons: options that the teacher rates better are preferred."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from lidarium.agents.learned.features import OPTION_FEATURES, TEAMMATE_FEATURES
from lidarium.training.decisions import MOST_OPTIONS, Decisions
from lidarium.training.settings import FitSettings
from lidarium.training.teaching.samples import Samples, by_width
from lidarium.training.torch_network import ExplorerNetwork, Seen

_MIRRORED_OPTION = tuple(list(OPTION_FEATURES).index(name) for name in ("left",))
_MIRRORED_TEAMMATE = tuple(list(TEAMMATE_FEATURES).index(name) for name in ("left", "sine", "target_left"))


GROUPS = (6, 12, 20, MOST_OPTIONS)
"""Decisions of up to so many options are fitted together."""


SPLIT_SEED = 9
"""Floors are held out by draws of this seed, whatever is trained."""


@dataclass(frozen=True, slots=True)
class Fit:
    """How a fit went on.

    Attributes
    ----------
    fitted, held_out : float
        Mean regret on the fitted samples, with options drawn by their preferences, and on the others, with
        the preferred one is taken [m].
    """

    fitted: float
    held_out: float


def fit(network: ExplorerNetwork, floors: list[Samples], settings: FitSettings, seed: int) -> Iterator[Fit]:
    """Fit a network to the samples of some floors, and keep its best epoch."""
    if len(floors) < 2:
        raise ValueError(f"there are lessons of {len(floors)} floors; want 2 at least: one is held out")
    generator = np.random.default_rng(seed)
    is_held_out = held_out_of(len(floors), settings.held_out)
    held_out = by_width([floors[k] for k in np.flatnonzero(is_held_out)], GROUPS)
    fitted = by_width([floors[k] for k in np.flatnonzero(~is_held_out)], GROUPS)
    optimizer = torch.optim.AdamW(network.parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, settings.epochs)
    best, least = network.weights(), np.inf
    for _ in range(settings.epochs):
        loss = _epoch(network, fitted, settings, optimizer, generator)
        schedule.step()
        found = Fit(loss, evaluate(network, held_out, settings))
        if found.held_out < least:
            best, least = network.weights(), found.held_out
        yield found
    network.set_weights(best)


def held_out_of(count: int, share: float) -> NDArray[np.bool_]:
    """Return which of some floors are held out, (count,) bool: one at least, and not all.

    A floor that is held out stays so when more follow: no round is fitted to samples that judge a later one.
    """
    draws = np.random.default_rng(SPLIT_SEED).random(count)
    is_held_out = draws < share
    is_held_out[np.argmin(draws)] = True
    is_held_out[np.argmax(draws)] = False
    return is_held_out


def evaluate(network: ExplorerNetwork, groups: Sequence[Samples], settings: FitSettings) -> float:
    """Return the mean regret of the preferred options [m]."""
    found = []
    with torch.no_grad():
        for samples in groups:
            regrets = np.minimum(samples.regrets, settings.most_regret)
            for start in range(0, len(samples), 1024):
                rows = np.arange(start, min(start + 1024, len(samples)))
                best = network(Seen(samples.decisions.take(rows)))[0].argmax(dim=1).numpy()
                found.append(regrets[rows, best])
    return float(np.concatenate(found).mean())


def _epoch(
    network: ExplorerNetwork,
    groups: Sequence[Samples],
    settings: FitSettings,
    optimizer: torch.optim.Optimizer,
    generator: np.random.Generator,
) -> float:
    """See all samples once, half of them mirrored; return the mean regret [m]."""
    total = 0.0
    for samples in _batches(groups, settings.batch, generator):
        regrets = torch.from_numpy(np.minimum(samples.regrets, settings.most_regret))
        decisions = samples.decisions
        seen = Seen(mirrored(decisions) if generator.random() < 0.5 else decisions)
        preferences, _ = network(seen)
        loss = (preferences.softmax(dim=1) * regrets).sum(dim=1).mean()
        corrections = (preferences - network.steepness * seen.scores)[seen.mask].square().mean()
        optimizer.zero_grad()
        (loss + settings.correction_cost * corrections).backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        total += loss.item() * len(samples)
    return total / sum(len(samples) for samples in groups)


def _batches(groups: Sequence[Samples], size: int, generator: np.random.Generator) -> Iterator[Samples]:
    """Yield all samples in batches, each of one group, in an order of chance."""
    batches = []
    for samples in groups:
        order = generator.permutation(len(samples))
        batches += [(samples, order[start : start + size]) for start in range(0, len(order), size)]
    for k in generator.permutation(len(batches)):
        samples, rows = batches[k]
        yield samples.take(rows)


def mirrored(decisions: Decisions) -> Decisions:
    """Return decisions with left and right exchanged."""
    options, teammates = decisions.options.copy(), decisions.teammates.copy()
    options[..., _MIRRORED_OPTION] *= -1.0
    teammates[..., _MIRRORED_TEAMMATE] *= -1.0
    crops = np.ascontiguousarray(decisions.crops[..., ::-1])
    return replace(decisions, options=options, teammates=teammates, crops=crops)
