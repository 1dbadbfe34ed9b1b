"""PPO in one file, in the manner of CleanRL: many robots choose frontiers, and one network scores these.

Usage: python docs/how_to/trainers/ppo.py
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.distributions import Categorical

import lidarium

ROBOT = {"level": "frontier", "observe": ["frontiers", "time_left"], "horizon_s": 60.0}
SCALES = torch.tensor([10.0, 10.0, 10.0, 3.0])


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What PPO is set to; lengths in decisions."""

    episodes: int = 32
    rollout: int = 32
    updates: int = 100
    epochs: int = 4
    minibatch: int = 128
    learning_rate: float = 1e-3
    discount: float = 0.98
    trace: float = 0.95
    clip: float = 0.2
    entropy: float = 0.01
    seed: int = 0

    @property
    def decisions(self) -> int:
        """Decisions of all robots in an update, one robot an episode."""
        return self.episodes * self.rollout


class Frontiers(nn.Module):
    """Features of each frontier, and their mean over those on offer."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.each = nn.Sequential(nn.Linear(5, width), nn.Tanh(), nn.Linear(width, width), nn.Tanh())

    def forward(self, frontiers: Tensor, time_left: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        """Return features (rows, frontiers, width), and their means (rows, width)."""
        time = time_left[:, None].expand(*frontiers.shape[:2], 1)
        features = self.each(torch.cat([frontiers / SCALES, time], -1))
        offered = mask[:, :-1, None]
        return features, (features * offered).sum(1) / offered.sum(1).clamp(min=1.0)


class Scorer(nn.Module):
    """Scores each frontier beside the mean of all; values have features of their own."""

    def __init__(self, width: int = 64) -> None:
        super().__init__()
        self.chosen, self.valued = Frontiers(width), Frontiers(width)
        self.score, self.stay = nn.Linear(2 * width, 1), nn.Linear(width, 1)
        self.value = nn.Sequential(nn.Linear(width, width), nn.Tanh(), nn.Linear(width, 1))

    def forward(self, frontiers: Tensor, time_left: Tensor, mask: Tensor) -> tuple[Categorical, Tensor]:
        """Return the distribution of choices, and the value of what is seen."""
        features, mean = self.chosen(frontiers, time_left, mask)
        beside = mean[:, None].expand_as(features)
        scores = self.score(torch.cat([features, beside], -1))[..., 0]
        logits = torch.cat([scores, self.stay(mean)], -1).masked_fill(mask < 0.5, -1e9)
        return Categorical(logits=logits), self.value(self.valued(frontiers, time_left, mask)[1])[:, 0]


class Rollout(NamedTuple):
    """What was seen and done, (decisions, rows, ...); ``is_idle`` marks rows whose action was ignored."""

    seen: tuple[Tensor, ...]
    actions: Tensor
    log_probabilities: Tensor
    values: Tensor
    rewards: Tensor
    terminated: Tensor
    ended: Tensor
    is_idle: Tensor


class Report(NamedTuple):
    """Of an update: the mean reward of a decision, and the mean coverage of episodes that ended."""

    earned: float
    coverage: float


def as_tensors(observations: dict[str, Any]) -> tuple[Tensor, ...]:
    """Return frontiers, time left and masks of all rows."""
    names = ("frontiers", "time_left", "action_mask")
    return tuple(torch.as_tensor(np.asarray(observations[name], np.float32)) for name in names)


class Learner:
    """Plays, and improves its network."""

    def __init__(self, env: Any, settings: Settings) -> None:  # noqa: ANN401
        torch.manual_seed(settings.seed)
        self.env, self.settings, self.network = env, settings, Scorer()
        self.optimiser = torch.optim.Adam(self.network.parameters(), settings.learning_rate)
        self.seen = as_tensors(env.reset(seed=settings.seed)[0])
        self.is_idle = torch.zeros(env.num_envs, dtype=torch.bool)
        self.coverages: list[float] = []

    @torch.no_grad()
    def play(self) -> tuple[Rollout, Tensor]:
        """Play for some decisions; return what came of it, and the value of what is seen at the end."""
        steps, self.coverages = [], []
        for _ in range(self.settings.rollout):
            choices, values = self.network(*self.seen)
            actions = choices.sample()
            observations, rewards, terminated, truncated, infos = self.env.step(actions.numpy())
            ended = torch.as_tensor(terminated | truncated)
            got = torch.as_tensor(rewards, dtype=torch.float32)
            log_probabilities = choices.log_prob(actions)
            gone = torch.as_tensor(terminated)
            steps.append((self.seen, actions, log_probabilities, values, got, gone, ended, self.is_idle))
            self.coverages += infos["truth"]["coverage"][terminated | truncated].tolist()
            self.seen = as_tensors(observations)
            # An episode that is over begins in the next step, whatever the action.
            self.is_idle = ended | ~torch.as_tensor(np.array(infos["active"]))
        seen = tuple(torch.stack(parts) for parts in zip(*(step[0] for step in steps), strict=True))
        rest = (torch.stack(parts) for parts in zip(*(step[1:] for step in steps), strict=True))
        return Rollout(seen, *rest), self.network(*self.seen)[1]

    def advantages(self, played: Rollout, last: Tensor) -> Tensor:
        """Return generalised advantages; what follows a truncated step is its own last observation."""
        following = torch.cat([played.values[1:], last[None]])
        errors = played.rewards + self.settings.discount * following * ~played.terminated - played.values
        found, carried = torch.zeros_like(errors), torch.zeros_like(last)
        for step in reversed(range(len(errors))):
            carried = errors[step] + self.settings.discount * self.settings.trace * carried * ~played.ended[step]
            carried = carried * ~played.is_idle[step]
            found[step] = carried
        return found

    def improve(self, played: Rollout, advantages: Tensor) -> None:
        """Take steps on the clipped objective, over rows that truly acted."""
        settings, chosen = self.settings, (~played.is_idle).reshape(-1)
        flat = [part.flatten(0, 1)[chosen] for part in (*played.seen, *played[1:4], advantages)]
        *seen, actions, before, values, gained = flat
        returns, gained = gained + values, (gained - gained.mean()) / (gained.std() + 1e-8)
        for _ in range(settings.epochs):
            for rows in torch.randperm(len(actions)).split(settings.minibatch):
                choices, guessed = self.network(*(part[rows] for part in seen))
                ratio = (choices.log_prob(actions[rows]) - before[rows]).exp()
                clipped = ratio.clamp(1.0 - settings.clip, 1.0 + settings.clip)
                gain = torch.minimum(ratio * gained[rows], clipped * gained[rows]).mean()
                error = 0.5 * (guessed - returns[rows]).square().mean()
                loss = error - gain - settings.entropy * choices.entropy().mean()
                self.optimiser.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(self.network.parameters(), 0.5)
                self.optimiser.step()


def train(options: dict[str, Any], settings: Settings) -> Iterator[tuple[Report, Scorer]]:
    """Train; yield a report of each update, and the network as it then is."""
    env = lidarium.vector_env(settings.episodes, **{**ROBOT, **options})
    learner = Learner(env, settings)
    for _ in range(settings.updates):
        played, last = learner.play()
        learner.improve(played, learner.advantages(played, last))
        earned = float(played.rewards[~played.is_idle].mean())
        yield Report(earned, float(np.mean(learner.coverages or [np.nan]))), learner.network


if __name__ == "__main__":
    torch.set_num_threads(1)
    for update, (report, _) in enumerate(train({"floor": "set:train"}, Settings())):
        print(f"update {update}: {report.earned:.3f} a decision, coverage {report.coverage:.2f}")
