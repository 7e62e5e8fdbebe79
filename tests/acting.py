"""Players asked by hand: what they do for what is seen, without the memory that a game would carry on."""

import jax

from apollonius.observe.view import look


def act(player, seen, bits):
    """Return a player's action at the start of a game."""
    return player(seen, player.memory, bits)[0]


def act_in_rows(players, member, seen, bits):
    """Return the actions of a pool's members for rows of numbers."""
    return players.act(member, lambda row: row, seen, players.memory, bits)[0]


def of_views(function, game, states, role, *rest):
    """Return what a function makes of one side's view in each of several games, and of the rest."""
    return jax.vmap(lambda state, *rest: function(look(game, state, role), *rest))(states, *rest)
