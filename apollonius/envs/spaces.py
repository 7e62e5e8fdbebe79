"""Spaces of observations and actions, for Gymnasium and PettingZoo."""

from typing import Any

import gymnasium
import numpy as np

from apollonius.game.types import NUM_ACTIONS
from apollonius.io.errors import require
from apollonius.observe.registry import find_observation

ACTIONS = ("discrete", "continuous")
"""Kinds of actions."""


def observation_space(observation: str, robots: int = 1) -> gymnasium.spaces.Box:
    """Return the space of observations.

    Every number is within 2 of 0, unless a robot leaves the walls by more than half the arena in one step.

    Args:
        observation: what each robot sees.
        robots: of several there is an axis.

    Raises:
        InvalidInput: for an unknown observation.
    """
    size = find_observation(observation).size
    return gymnasium.spaces.Box(-2.0, 2.0, (size,) if robots == 1 else (robots, size), np.float32)


ActionSpace = gymnasium.spaces.Discrete | gymnasium.spaces.MultiDiscrete | gymnasium.spaces.Box


def action_space(actions: str, robots: int = 1) -> ActionSpace:
    """Return the space of actions: the nine of Eq. 5, or shares of the largest acceleration and turn rate.

    Args:
        robots: of several there is an axis.

    Raises:
        InvalidInput: for an unknown kind of actions.
    """
    require(actions in ACTIONS, "actions", actions, f"one of {', '.join(ACTIONS)}")
    if actions == "continuous":
        return gymnasium.spaces.Box(-1.0, 1.0, (2,) if robots == 1 else (robots, 2), np.float32)
    several = gymnasium.spaces.MultiDiscrete([NUM_ACTIONS] * robots)
    return gymnasium.spaces.Discrete(NUM_ACTIONS) if robots == 1 else several


def as_actions(given: Any, space: ActionSpace, batch: tuple[int, ...] = ()) -> np.ndarray:
    """Return actions of a space in its number type: one, or a batch.

    Raises:
        InvalidInput: for another shape or type, or an action outside the space.
    """
    discrete = not isinstance(space, gymnasium.spaces.Box)
    name, kind = "actions" if batch else "action", "a whole number" if discrete else "numbers"
    shape = batch if discrete else (*batch, 2)
    least, most = (0, NUM_ACTIONS - 1) if discrete else (-1, 1)
    try:
        actions = np.asarray(given)
    except ValueError:  # of lists of several lengths
        actions = np.asarray(None)
    # A message costs as much as a step of the game.
    if actions.dtype.kind not in ("iu" if discrete else "iuf"):
        require(False, name, given, f"{kind} from {least} to {most}")
    if actions.shape != shape:
        require(False, f"shape of {name}", actions.shape, str(shape))
    low, high = (actions.min(), actions.max()) if shape else (actions, actions)
    if not (least <= low and high <= most):
        require(False, name, low if low == high else f"{low} to {high}", f"from {least} to {most}")
    return actions.astype(np.int32 if discrete else np.float32)
