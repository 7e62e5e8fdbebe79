"""What Gymnasium and PettingZoo are told of observations and actions."""

import gymnasium
import numpy as np

from apollonius.errors import require
from apollonius.game.observation import OBSERVATION_SIZES
from apollonius.game.types import NUM_ACTIONS


def observation_space(profile: str) -> gymnasium.spaces.Box:
    """Every number is within 2 of 0, unless a robot leaves the walls by more than half the arena in one step.

    Raises:
        InvalidInput: for an unknown profile.
    """
    require(profile in OBSERVATION_SIZES, "observation", profile, f"one of {', '.join(OBSERVATION_SIZES)}")
    return gymnasium.spaces.Box(-2.0, 2.0, (OBSERVATION_SIZES[profile],), np.float32)


def action_space() -> gymnasium.spaces.Discrete:
    """The nine actions of Eq. 5."""
    return gymnasium.spaces.Discrete(NUM_ACTIONS)
