"""A game in words, as pictures and commands print it."""

from collections.abc import Sequence
from math import hypot

from apollonius.game.game import Game
from apollonius.game.types import Outcome
from apollonius.replay import Replay, Trajectory


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
