"""Matches of players that nobody has named."""

from apollonius.agents.kind import Named
from apollonius.evaluate.match import Match
from apollonius.game.by_side import BySide


def a_match(game, pursuer, evader, games, seed=0, **which):
    """A match of two policies."""
    return Match(game, BySide(Named("pursuer", pursuer), Named("evader", evader)), games, seed, **which)
