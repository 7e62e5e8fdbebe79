"""Spaces of observations and actions for Gymnasium and PettingZoo."""

from typing import Any

import gymnasium
import numpy as np

from apollonius.game.types import NUM_ACTIONS
from apollonius.io.errors import require
from apollonius.observe.registry import find_observation


def observation_space(observation: str, robots: int = 1) -> gymnasium.spaces.Box:
    """Return the space of observations, within 2 of 0 unless a robot goes half an arena beyond the walls in one step.

    Args:
        observation: of each robot.
        robots: their number; several have an axis.

    Raises:
        InvalidInput: for an unknown observation.
    """
    size = find_observation(observation).size
    return gymnasium.spaces.Box(-2.0, 2.0, (size,) if robots == 1 else (robots, size), np.float32)


def action_space(actions: str, robots: int = 1) -> gymnasium.spaces.Space[Any]:
    """Return the nine actions of Eq. 5, or shares of the largest acceleration and of the largest turn rate.

    Args:
        actions: `discrete` or `continuous`.
        robots: their number; several have an axis.

    Raises:
        InvalidInput: for an unknown kind of actions.
    """
    require(actions in ("discrete", "continuous"), "actions", actions, "one of discrete, continuous")
    if actions == "continuous":
        return gymnasium.spaces.Box(-1.0, 1.0, (2,) if robots == 1 else (robots, 2), np.float32)
    return (
        gymnasium.spaces.Discrete(NUM_ACTIONS)
        if robots == 1
        else gymnasium.spaces.MultiDiscrete([NUM_ACTIONS] * robots)
    )


def as_actions(given: Any, kind: str, batch: tuple[int, ...] = ()) -> np.ndarray:
    """Return one action of a kind or a batch in its number type.

    Raises:
        InvalidInput: for another shape or type, or an action outside the space.
    """
    discrete = kind == "discrete"
    name, numbers = "actions" if batch else "action", "a whole number" if discrete else "numbers"
    shape = batch if discrete else (*batch, 2)
    least, most = (0, NUM_ACTIONS - 1) if discrete else (-1, 1)
    try:
        actions = np.asarray(given)
    except ValueError:  # of lists of several lengths
        actions = np.asarray(None)
    # A message costs as much as a step of the game.
    if actions.dtype.kind not in ("iu" if discrete else "iuf"):
        require(False, name, given, f"{numbers} from {least} to {most}")
    if actions.shape != shape:
        require(False, f"shape of {name}", actions.shape, str(shape))
    low, high = (actions.min(), actions.max()) if shape else (actions, actions)
    if not (least <= low and high <= most):
        require(False, name, low if low == high else f"{low} to {high}", f"from {least} to {most}")
    return actions.astype(np.int32 if discrete else np.float32)
