"""A game in words: its sides, how it stands and how it ended."""

from collections.abc import Sequence
from math import hypot

import numpy as np
from jaxtyping import Bool

from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.play.replay import Replay


def side_name(game: Game, role: Role) -> str:
    """Return the name of a side: `pursuer`, or `3 pursuers`."""
    count, name = len(game.bodies[role]), role.name.lower()
    return name if count == 1 else f"{count} {name}s"


def in_play(replay: Replay) -> Bool[np.ndarray, "rows robots"]:
    """Return for each state which robots are in play; in a game of two both are, to the end."""
    if replay.game.teams is None:
        return np.ones((len(replay.states), 2), bool)
    return np.stack([np.asarray(robot) for side in replay.trajectory().states.active for robot in side], axis=-1)


def describe_end(replay: Replay) -> str:
    """Return how and when a game ended, as `captured after 12.3 s`."""
    outcome = replay.outcome.name.lower().replace("_", " ")
    return f"{outcome} after {len(replay.actions) * float(replay.game.dt):.1f} s"


def describe_play(game: Game, robots: Sequence[float], active: Sequence[bool]) -> str:
    """Return the least distance of a pursuer and an evader; for teams also the numbers of robots in play.

    Args:
        robots: x [m], y [m], v [m/s], heading [rad] of each pursuer, then of each evader.
        active: for each robot, whether it is in play.
    """
    points = [robots[first : first + 2] for first in range(0, len(robots), 4)]
    first_evader = len(game.bodies.pursuer)
    sides = slice(None, first_evader), slice(first_evader, None)
    pursuers, evaders = ([at for at, plays in zip(points[side], active[side], strict=True) if plays] for side in sides)
    apart = min((hypot(ex - px, ey - py) for px, py in pursuers for ex, ey in evaders), default=None)
    distance = "" if apart is None else f"distance {apart:.2f} m"
    if game.teams is None:
        return distance
    return f"{len(pursuers)} v {len(evaders)} in play{distance and ', '}{distance}"
