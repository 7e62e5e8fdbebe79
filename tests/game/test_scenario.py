"""Games in several arenas at once: each goes as it goes alone, and one arena is as before."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.chasing import PurePursuit
from apollonius.agents.greedy import Greedy
from apollonius.agents.network import make_network
from apollonius.agents.pool import solo
from apollonius.agents.uniform import Uniform
from apollonius.arenas.record import to_dict
from apollonius.evaluate.result import count_by_arena
from apollonius.game.arena import Arena, Disc
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.polygon import Polygon
from apollonius.game.scenario import in_arenas, padded
from apollonius.game.types import Outcome, Role
from apollonius.io.errors import InvalidInput
from apollonius.play.playout import Results, play_out
from apollonius.play.rollout import begin, collect
from apollonius.solve.motion import motion_of

AGILE = Unicycle(v_max=2.0, u1_max=4.0, u2_max=3.0)
NARROW = Arena(0.0, 4.0, 0.0, 4.0, discs=(Disc(2.0, 2.0, 0.4),))
WIDE = Arena(
    -1.0,
    5.0,
    0.0,
    4.0,
    discs=(Disc(1.0, 1.0, 0.3), Disc(3.0, 3.0, 0.3)),
    polygons=(Polygon(((2, 0.5), (4, 0.5), (3, 2))),),
)
GAME = Game(AGILE, AGILE, NARROW, max_steps=60)
BOTH = in_arenas(GAME, [NARROW, WIDE])
GAMES = 40
sample = jax.jit(reset_batch, static_argnames="games")


def outcomes(game, players, starts):
    results = play_out(game, players, starts, jax.random.key(3))
    return np.asarray(results.outcome), np.asarray(results.steps)


def test_games_in_two_arenas_go_as_each_goes_alone():
    """The same starts, half of them in either arena, next to each other: outcomes and lengths.

    The evader is a network that sees clearances; the pursuer minds no obstacle.
    """
    network = jax.tree.map(lambda leaf: 4 * leaf, make_network("encoded", 8, 2, jax.random.key(1)))
    both = BySide(solo(PurePursuit.for_side(GAME, Role.PURSUER)), solo(Greedy(network)))
    alone = [replace(GAME, arena=BOTH.scenario.arena(jnp.int32(place))) for place in (0, 1)]
    starts = [sample(game, jax.random.key(1), GAMES) for game in alone]
    expected = [outcomes(game, both, start) for game, start in zip(alone, starts, strict=True)]
    mixed = jax.tree.map(lambda one, other: jnp.stack([one, other], axis=1).reshape(-1), *starts)
    mixed = jax.vmap(lambda state, place: replace(state, place=place))(mixed, jnp.arange(2 * GAMES) % 2)
    found = outcomes(BOTH, both, mixed)
    for place in (0, 1):
        for measured, known in zip(found, expected[place], strict=True):
            np.testing.assert_array_equal(measured[place::2], known)
    assert len(set(expected[0][0]) | set(expected[1][0])) > 1
    assert not np.array_equal(expected[0][1], expected[1][1])


def test_games_begin_in_every_arena_where_there_is_room_and_again_in_any():
    starts = sample(BOTH, jax.random.key(0), 400)
    share = np.asarray(starts.place).mean()
    assert 0.4 < share < 0.6
    for place, arena in enumerate((NARROW, WIDE)):
        there = np.asarray(starts.place) == place
        rooms = np.asarray(jax.vmap(arena.clearance)(starts.pursuer.x, starts.pursuer.y))[there]
        assert rooms.min() >= GAME.starts.clearance - 1e-5
    left = np.asarray(starts.pursuer.x)[np.asarray(starts.place) == 1]
    assert left.min() < -0.3  # only one of them reaches so far

    @jax.jit
    def play(game, starts):
        players, words = BySide(solo(Uniform()), solo(Uniform())), jnp.arange(200, dtype=jnp.uint32).reshape(2, 100)
        rows = jax.tree.map(lambda leaf: leaf.reshape(4, 100), starts)
        games = begin(jax.tree.map(lambda leaf: leaf[0], rows), players, words)
        return collect(game, players, games, rows, jax.random.key(1), 80)

    games, transitions = play(BOTH, starts)
    ended = np.asarray(transitions.terminated | transitions.truncated)
    assert (ended.sum(axis=0) > 0).all()
    changed = np.asarray(games.state.place) != np.asarray(starts.place[:100])
    assert 20 < changed.sum() < 80


def test_one_arena_is_a_game_as_ever():
    assert in_arenas(GAME, [WIDE]) == replace(GAME, arena=WIDE)
    assert len(jax.tree.leaves(GAME.reset(jax.random.key(0)))) == 9


def test_what_fills_an_empty_place_touches_nothing():
    more = padded(WIDE, discs=5, polygons=3, corners=6)
    assert [len(one.vertices) for one in more.polygons] == [6, 6, 6]
    rng = np.random.default_rng(0)
    before, after = (
        jax.vmap(type(GAME.reset(jax.random.key(0)).pursuer))(*(jnp.asarray(row, jnp.float32) for row in rows))
        for rows in rng.uniform(-1, 5, (2, 4, 500))
    )
    for ask in (
        lambda arena, one, other: arena.clearance(one.x, one.y),
        lambda arena, one, other: arena.clearance_along(one, other),
        lambda arena, one, other: arena.hits_obstacle(one, other, 0.1),
    ):
        few, many = (jax.jit(jax.vmap(ask, (None, 0, 0)))(arena, before, after) for arena in (WIDE, more))
        np.testing.assert_array_equal(few, many)
    bare = Arena(discs=(Disc(1.0, 1.0, 0.5),))
    assert padded(bare, discs=1, polygons=0, corners=0) == bare
    with pytest.raises(InvalidInput, match=r"discs, polygons, corners = \(2, 1, 3\) .* at most \(1, 1, 3\)"):
        padded(WIDE, 1, 1, 3)


def test_what_must_know_the_arena_beforehand_refuses_several_in_a_line():
    with pytest.raises(InvalidInput, match=r"^arenas = 2 is not possible: it must be one, which a table"):
        motion_of(BOTH, Role.PURSUER, 1)
    with pytest.raises(InvalidInput, match="has no file"):
        to_dict(BOTH)
    with pytest.raises(InvalidInput, match="arenas = none"):
        in_arenas(GAME, [])
    with pytest.raises(InvalidInput, match="all with a territory or all without"):
        in_arenas(GAME, [NARROW, replace(WIDE, territory=Disc(0.0, 3.0, 0.3))])
    with pytest.raises(InvalidInput, match=r"arena.discs\[0\] centre"):
        in_arenas(GAME, [NARROW, Arena(0.0, 4.0, 0.0, 4.0, discs=(Disc(9.0, 2.0, 0.4),))])


def test_arenas_in_which_nothing_was_played_are_not_counted():
    """A third arena has no game of the two; the pursuer wins that of the first."""
    scenario = in_arenas(GAME, [NARROW, WIDE, NARROW]).scenario
    results = Results(jnp.array([Outcome.CAPTURED, Outcome.NO_RESULT]), jnp.array([3, 4]))
    counted = count_by_arena(scenario, results)
    assert (counted.wins, counted.games) == ((1, 0), (1, 1))
