"""The empirical game between kept versions: who is played, how it is counted, what is drawn from it."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chisquare

from apollonius.game.by_side import BySide
from apollonius.game.game import reset_batch
from apollonius.game.types import Outcome, Role
from apollonius.learn.opponents import archive as archives_
from apollonius.learn.opponents import payoffs
from apollonius.learn.opponents.opponent_config import OpponentConfig
from apollonius.learn.opponents.scheme import find_scheme
from apollonius.learn.self_play import renew_opponents, start_self_play
from apollonius.observe.registry import observe
from tests.learn.test_opponents import archive_of, plan_of
from tests.learn.tiny import CHUNK, GAME

GAMES = 24
CONFIG = OpponentConfig(scheme="psro", versions=4, seats=2, renewal=CHUNK, payoff_games=GAMES)
KEY = jax.random.key(5)


def by_hand(pursuer, evader):
    """The pursuer's share of wins, a step at a time, from the starts that all matches share."""
    state = reset_batch(GAME, jax.random.split(KEY)[0], GAMES)
    ended = np.full(GAMES, Outcome.ONGOING)

    @jax.jit
    @jax.vmap
    def step(state):
        players = ((pursuer, Role.PURSUER), (evader, Role.EVADER))
        values = [network(observe(GAME, state, role, "paper")) for network, role in players]
        return GAME.step(state, *[jnp.argmax(of_all).astype(jnp.int32) for of_all in values])

    for _ in range(GAME.max_steps):
        timestep = step(state)
        ended = np.where(ended == Outcome.ONGOING, timestep.outcome, ended)
        state = timestep.state
    return np.isin(ended, [Outcome.CAPTURED, Outcome.EVADER_HIT_OBSTACLE, Outcome.EVADER_OUT_OF_RANGE]).mean()


@pytest.fixture(scope="module")
def archives():
    """Of three pursuers and two evaders."""
    with jax.numpy_dtype_promotion("standard"):
        return BySide(archive_of(3, CONFIG), archive_of(2, CONFIG, seed=7))


play = jax.jit(lambda before, archives, key: payoffs.play_missing(before, GAME, archives, GAMES, key))


@pytest.fixture(scope="module")
def table(archives):
    return play(payoffs.nothing_played(4), archives, KEY)


def test_a_payoff_is_the_share_of_games_that_the_pursuer_wins(archives, table):
    pairs = [(row, column) for row in range(3) for column in range(2)]
    expected = [
        by_hand(*(archive.version(jnp.asarray(at)) for archive, at in zip(archives, pair, strict=True)))
        for pair in pairs
    ]
    assert len(set(expected)) > 2
    np.testing.assert_allclose([table[pair] for pair in pairs], expected, rtol=1e-6)


def test_versions_that_are_not_there_do_not_play(table):
    assert np.isnan(table).tolist() == [[False, False, True, True]] * 3 + [[True] * 4]


def test_nobody_plays_twice(archives, table):
    known = table.at[1, 1].set(0.123)
    np.testing.assert_array_equal(play(known, archives, KEY), known)
    np.testing.assert_array_equal(play(known.at[2, 0].set(jnp.nan), archives, KEY), known)


def test_seats_follow_the_solution_of_the_empirical_game():
    """Three versions in rock, paper, scissors that pays more for rock; the fourth is not there."""
    mixed = find_scheme("psro").mix(np.array([[0.5, 0.0, 1.0], [1.0, 0.5, 0.25], [0.0, 0.75, 0.5]]))
    np.testing.assert_allclose(mixed.pursuer, [0.2, 0.4, 0.4], atol=1e-6)
    fleeing = np.pad(mixed.evader, (0, 1)).astype(np.float32)
    archive = archive_of(3, CONFIG)
    drawn = jax.jit(jax.vmap(lambda key: archives_.renew(archive, CONFIG, key, jnp.asarray(fleeing)).seats))(
        jax.random.split(jax.random.key(3), 5000)
    )
    seen = np.bincount(np.asarray(drawn).ravel(), minlength=4)
    assert seen[3] == 0
    assert chisquare(seen[:3], 10_000 * fleeing[:3] / fleeing.sum()).pvalue > 0.001
    assert chisquare(seen[:3], 10_000 * fleeing[[1, 0, 2]] / fleeing.sum()).pvalue < 1e-6


def test_the_pursuer_raises_the_payoff_and_the_evader_lowers_it():
    mixed = find_scheme("psro").mix(np.array([[0.9, 0.6], [0.5, 0.1]]))
    assert mixed.pursuer[0] > 0.8
    assert mixed.evader[1] > 0.8


def test_seats_of_a_renewal_follow_the_matches_of_the_versions_that_there_are():
    """The first pursuer is the best against each evader, and the second evader the best against it."""
    plan = plan_of(CONFIG)
    state = start_self_play(plan, GAME, jax.random.key(0), BySide(None, None))
    known = np.array([[0.9, 0.8, 0.9, 0.9], *[[0.1] * 4] * 3], np.float32)
    versions = state.past.archives.map(lambda archive: replace(archive, count=jnp.asarray(4)))
    state = renew_opponents(
        plan, GAME, replace(state, past=replace(state.past, archives=versions, payoffs=jnp.asarray(known)))
    )
    assert [archive.seats.tolist() for archive in state.past.archives] == [[0, 0], [1, 1]]
    np.testing.assert_array_equal(state.past.payoffs, known)
