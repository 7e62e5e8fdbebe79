"""Starts of a match: those of the game's file, or others by a word."""

from dataclasses import replace
from enum import Enum

from jaxtyping import PRNGKeyArray

from apollonius.game.game import Game, sample_starts
from apollonius.game.types import GameState
from apollonius.io.errors import InvalidInput
from apollonius.solve.viability import doomed_start_rate, solve_viability, viable_starts


class StartFilter(Enum):
    """The starts of a game that are played."""

    ALL = "all"
    VIABLE = "viable"
    """Starts from which both robots can stay clear of everything (`apollonius.solve.viability`)."""

    def sample(self, game: Game, key: PRNGKeyArray, games: int) -> GameState:
        """Draw initial states of several games, leaves `[games]`. The key is consumed.

        Raises:
            InvalidInput: when hardly any start of the game is viable, and as `solve_viability`.
        """
        if self is StartFilter.ALL or _starts_at_rest(game):
            return sample_starts(game, key, games)
        return viable_starts(game, solve_viability(game), key, games)

    def word(self, game: Game) -> str:
        """Return the word for these starts of a game: `rest`, `moving` or `viable`, as of `starting`."""
        return self.value if self is StartFilter.VIABLE else game.starts.speed

    def doomed_rate(self, game: Game) -> float | None:
        """Return the share of these starts that are lost before they begin; None where it cannot be solved for."""
        if self is StartFilter.VIABLE or _starts_at_rest(game):
            return 0.0
        try:
            return doomed_start_rate(game, solve_viability(game))
        except InvalidInput:  # several arenas, several kinds of robots, a grid that memory has no room for
            return None


def starting(game: Game, starts: str | None) -> tuple[Game, StartFilter]:
    """Return a game with the starts that a word asks for, and the filter of those that are played.

    Args:
        starts: initial speeds, `rest` or `moving`; or `viable`: moving, but for starts that are lost before they begin.
            None for the game's own.

    Raises:
        InvalidInput: for `viable` in several arenas.
    """
    if starts is None:
        return game, StartFilter.ALL
    if starts == "viable":
        game.require_one_arena("a match from viable starts")
    speed = "rest" if starts == "rest" else "moving"
    which = StartFilter.VIABLE if starts == "viable" else StartFilter.ALL
    return replace(game, starts=replace(game.starts, speed=speed)), which


def _starts_at_rest(game: Game) -> bool:
    """Return whether all robots start where they can stay, so that no start is lost."""
    return all(bool(body.v_min <= 0) for side in game.bodies for body in side) and game.starts.speed == "rest"
