"""The robots of a game, for whatever draws them: whose they are, how their sign looks, and when they are in play."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.replay import Replay, Trajectory
from apollonius.show.palette import EVADER, PURSUER


@dataclass(frozen=True)
class Drawn:
    """A robot that is to be drawn.

    Attributes:
        role: its side.
        mark: its number in its team, from 1, as a text; none where it is alone.
        radius: of its body [m].
    """

    role: Role
    mark: str
    radius: float

    @property
    def colour(self) -> str:
        """That of its side."""
        return EVADER if self.role else PURSUER


def robots_of(game: Game) -> list[Drawn]:
    """All robots of a game, in the order of a replay's states."""
    return [
        Drawn(role, str(number) if len(game.bodies[role]) > 1 else "", float(body.radius))
        for role in Role
        for number, body in enumerate(game.bodies[role], start=1)
    ]


def side_name(game: Game, role: Role) -> str:
    """What a side is called: `pursuer`, or `3 pursuers`."""
    count, name = len(game.bodies[role]), role.name.lower()
    return name if count == 1 else f"{count} {name}s"


def in_play(game: Game, played: Trajectory | Replay) -> Bool[np.ndarray, "rows robots"]:
    """Which robots are in play in each state of a game; in a game of two both are, to the end."""
    if game.teams is None:
        return np.ones((len(played.actions) + 1, 2), bool)
    trajectory = played.trajectory() if isinstance(played, Replay) else played
    return np.stack([np.asarray(robot) for side in trajectory.states.active for robot in side], axis=-1)
