"""Robots placed by hand, players asked by hand without the memory that a game would carry on, and their matches."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.agents.source import NamedPlayer
from apollonius.evaluate.match import Match
from apollonius.game.types import BySide, GameState, RobotState
from apollonius.observe.registry import find_observation
from apollonius.observe.view import look
from apollonius.play.playout import Results


def robot(x, y, v=0.0, heading=0.0):
    return RobotState(*map(jnp.float32, (x, y, v, heading)))


def state(pursuer, evader):
    """Return the start of a game of two, from x, y, v and heading of each."""
    return GameState.of_two(robot(*pursuer), robot(*evader), jnp.int32(0))


def state_of(pursuers, evaders, statuses):
    """Return the start of a game of teams, from places and statuses of either side."""
    robots = BySide(*(tuple(robot(*place) for place in side) for side in (pursuers, evaders)))
    status = BySide(*(tuple(map(jnp.int32, side)) for side in statuses))
    return replace(GameState.at_start(robots), status=status)


def results_of(outcome, steps):
    """Return results of games of two by their outcomes and numbers of steps; no status is looked at."""
    status = jnp.zeros_like(steps)
    return Results(outcome, steps, BySide((status,), (status,)))


def act(player, seen, bits):
    """Return a player's action at the start of a game."""
    return player(seen, player.memory, bits)[0]


def act_in_rows(players, member, seen, bits):
    """Return the actions of a pool's members for rows of numbers."""
    return players.act(member, lambda row: row, seen, players.memory, bits)[0]


def observe(game, state, role, name):
    """Return the observation of this name for one side."""
    return find_observation(name)(look(game, state, role))


def of_views(function, game, states, role, *rest):
    """Return what a function makes of one side's view in each of several games, and of the rest."""
    return jax.vmap(lambda state, *rest: function(look(game, state, role), *rest))(states, *rest)


def a_match(game, pursuer, evader, games, seed=0, **which):
    """Return a match of two policies that nobody has named."""
    return Match(game, BySide(NamedPlayer("pursuer", pursuer), NamedPlayer("evader", evader)), games, seed, **which)


@jax.jit
def clearances(one, x, y):
    """Return the clearances of points in an arena, or from whatever else has them."""
    return jax.vmap(lambda x, y: one.clearance(x, y))(x, y)


def identical(one, other):
    """Check whether two pytrees of arrays are the same to the bit."""
    return jax.tree.all(jax.tree.map(np.array_equal, one, other))
