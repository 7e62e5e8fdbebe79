"""A game in words, as pictures and commands print it."""

from apollonius.game.game import Game
from apollonius.game.types import Outcome
from apollonius.replay import Replay, Trajectory


def describe_end(game: Game, played: Trajectory | Replay) -> str:
    """How a game ended and when, as `captured after 12.3 s`."""
    name = Outcome(int(played.outcome)).name.lower().replace("_", " ")
    return f"{name} after {len(played.actions) * float(game.dt):.1f} s"
