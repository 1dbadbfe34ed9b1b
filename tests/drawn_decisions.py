"""Decisions drawn at random, for tests of networks."""

import numpy as np

from lidarium.agents.learned.decision import CROP_SIDE, Decision
from lidarium.agents.learned.features import OPTION_FEATURES, SITUATION_FEATURES, TEAMMATE_FEATURES


def drawn_decision(generator, options=5, teammates=2):
    """Return a decision of which one option is not allowed."""
    scores = -generator.uniform(0.1, 5.0, options).astype(np.float32)
    scores[1] = 0.0
    mask = np.ones(options, np.bool_)
    mask[-1] = options < 3
    return Decision(
        generator.normal(size=(options, len(OPTION_FEATURES))).astype(np.float32),
        generator.integers(-1, 2, (options, CROP_SIDE, CROP_SIDE)).astype(np.int8),
        generator.normal(size=(teammates, len(TEAMMATE_FEATURES))).astype(np.float32),
        generator.normal(size=len(SITUATION_FEATURES)).astype(np.float32),
        scores,
        mask,
    )
