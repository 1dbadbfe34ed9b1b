"""Floors of a training's episodes: of the training set, the same without furniture, and dungeons."""

from dataclasses import dataclass, replace

import numpy as np

from lidarium.agents.learned.network import NO_PREDICTOR
from lidarium.envs.floors.catalogue.names import SETS
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.generation.buildings import BuildingSettings, generate_building
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.training.prediction.dungeons import draw_dungeon
from lidarium.training.prediction.settings import DUNGEON
from lidarium.training.settings import Round, TrainingSettings


@dataclass(frozen=True, slots=True)
class Place:
    """Floor and settings of an episode.

    Attributes
    ----------
    floor : str or Floor
        Name of the floor, a floor without furniture, or a dungeon.
    settings : ExplorationSettings
        The team; it ends at ``stop_coverage``.
    seed : int
        Of the episode.
    predictor : str
        Predictor of the team's maps.
    """

    floor: str | Floor
    settings: ExplorationSettings
    seed: int
    predictor: str = NO_PREDICTOR

    @property
    def name(self) -> str:
        """Name of the floor, for people."""
        return self.floor if isinstance(self.floor, str) else self.floor.name


def place_of(training: TrainingSettings, stage: Round, number: int) -> Place:
    """Return where the n-th episode of a training takes place.

    Seeds of floors are those of the training set, from the first on, and begin again behind the last; a floor of
    another kind with such a seed is in no other set.
    """
    generator = np.random.default_rng([training.seed, 3, number])
    first, count = SETS["train"]
    often = np.array(list(stage.kinds.values()), np.float64)
    kind = generator.choice(list(stage.kinds), p=often / often.sum())
    robots = int(generator.choice(stage.robots))
    seed = first + number % count
    is_bare = generator.random() < stage.bare_share
    if kind == DUNGEON:
        return Place(draw_dungeon(seed), training.team(robots), number, training.predictor)
    floor = _bare(kind, seed) if is_bare else f"{kind}:{seed}"
    return Place(floor, training.team(robots), number, training.predictor)


def _bare(kind: str, seed: int) -> Floor:
    floor = generate_building(seed, BuildingSettings(kind="any" if kind == "building" else kind, clutter=0.0))
    return replace(floor, name=f"{floor.name} without furniture")


def first_number(training: TrainingSettings, number: int) -> int:
    """Return the number of the first episode of a round, or after all rounds."""
    return sum(each.floors for each in training.rounds[:number])
