"""What is drawn and said of a game: its robots, the shapes of its arena, and how it stands in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot

import numpy as np
from jaxtyping import Bool

from apollonius.game.arena import Arena, Disc
from apollonius.game.game import Game
from apollonius.game.types import Outcome, Role
from apollonius.play.replay import Replay, Trajectory
from apollonius.show.palette import EVADER, INK, OBSTACLE, PURSUER


@dataclass(frozen=True)
class Round:
    """A disc, or a ring where it is not filled: centre and radius [m]."""

    x: float
    y: float
    radius: float
    colour: str
    filled: bool = True


@dataclass(frozen=True)
class Straight:
    """A shape with straight edges: corners x, y [m]; only its edge where it is not filled."""

    corners: tuple[tuple[float, float], ...]
    colour: str
    filled: bool = True


def shapes(arena: Arena) -> list[Round | Straight]:
    """Obstacles, territory and walls of an arena; the cells of a map, which are a picture already, apart."""
    x, y, x_max, y_max = (float(end) for end in (arena.x_min, arena.y_min, arena.x_max, arena.y_max))
    found: list[Round | Straight] = []
    for one in arena.obstacles:
        if isinstance(one, Disc):
            found.append(Round(float(one.x), float(one.y), float(one.radius), OBSTACLE))
        elif one.outline():
            found.append(Straight(tuple((float(x), float(y)) for x, y in one.outline()), OBSTACLE))
    if arena.territory:
        goal = arena.territory
        found.append(Round(float(goal.x), float(goal.y), float(goal.radius), EVADER, filled=False))
    return [*found, Straight(((x, y), (x_max, y), (x_max, y_max), (x, y_max)), INK, filled=False)]


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


def describe_end(game: Game, played: Trajectory | Replay) -> str:
    """How a game ended and when, as `captured after 12.3 s`."""
    name = Outcome(int(played.outcome)).name.lower().replace("_", " ")
    return f"{name} after {len(played.actions) * float(game.dt):.1f} s"


def describe_play(game: Game, robots: Sequence[float], active: Sequence[bool]) -> str:
    """How far pursuer and evader are apart; of teams how many robots are in play, and the least of these distances.

    Args:
        robots: x [m], y [m], v [m/s], heading [rad] of each pursuer, then of each evader.
        active: which of them are in play.
    """
    places = [robots[first : first + 2] for first in range(0, len(robots), 4)]
    first_evader = len(game.bodies.pursuer)
    sides = slice(None, first_evader), slice(first_evader, None)
    pursuers, evaders = ([at for at, plays in zip(places[side], active[side], strict=True) if plays] for side in sides)
    apart = min((hypot(ex - px, ey - py) for px, py in pursuers for ex, ey in evaders), default=None)
    distance = "" if apart is None else f"distance {apart:.2f} m"
    if game.teams is None:
        return distance
    return f"{len(pursuers)} v {len(evaders)} in play{distance and ', '}{distance}"
