"""The small league: exploiters sit beside earlier versions, learn from games against the other side's learner only, and
leave their copies in the archive."""

from dataclasses import replace
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.game.types import Outcome, Role
from apollonius.learn import opponents, replay
from apollonius.learn.scheme import OpponentConfig
from apollonius.learn.seats import against_learner
from tests.learn.test_opponents import GAMES, archive_of, networks, play, same
from tests.learn.tiny import CHUNK

CONFIG = OpponentConfig(scheme="league", versions=8, seats=2, exploiter_seats=1, renewal=CHUNK)
"""64 games: 16 of earlier pursuers or their exploiter (8 each), 16 of evaders, 32 of the two learners."""


@pytest.fixture(scope="module")
def played():
    """Four chunks, renewed before the second and the last: states after each of these."""
    return play(CONFIG, 4, renewed=(1, 3))


def test_the_exploiter_has_the_last_seats_and_explores_like_the_learner():
    archive = opponents.renew(archive_of(3, CONFIG), CONFIG, jax.random.key(0))
    *_, learner, exploiter = networks(5)
    players = opponents.seat(archive, CONFIG, Role.PURSUER, learner, jnp.asarray(0.25), GAMES, exploiter)
    assert archive.seats.tolist()[1] == CONFIG.versions
    earlier, last = (jax.tree.map(lambda leaf, at=at: leaf[at], players.seated) for at in (0, 1))
    assert same(last.network, exploiter)
    assert same(earlier.network, opponents.version(archive, archive.seats[0]))
    assert players.seated.epsilon.tolist() == [0.0, 0.25]
    assert players.draw(jnp.zeros(GAMES, jnp.uint32)).tolist() == [1] * 8 + [2] * 8 + [0] * 48


def test_games_of_an_exploiter_are_counted_for_no_version():
    archive = replace(archive_of(3, CONFIG), seats=jnp.asarray([1, CONFIG.versions]))
    outcome = jnp.full((5, GAMES), Outcome.CAPTURED)
    archive = opponents.record(archive, CONFIG, Role.EVADER, outcome, jnp.ones((5, GAMES), bool))
    assert archive.games.tolist() == [0, 40, 0, 0, 0, 0, 0, 0]
    assert archive.lost.tolist() == [0, 40, 0, 0, 0, 0, 0, 0]


@pytest.mark.parametrize("role", Role)
@pytest.mark.slow
def test_an_exploiter_learns_from_games_with_the_other_sides_learner_only(played, role):
    """In which the other side's member is 0, the player at large."""
    games = played[-1].games
    met = games.sides[role.other].member
    first, count = against_learner(CONFIG, role, GAMES)
    among = (first + np.arange(count)) % GAMES
    assert np.flatnonzero(met == 0).tolist() == sorted(among)


def test_samples_come_from_the_games_that_are_asked_for():
    memory = replay.init(8, GAMES, 1, replay.DISCRETE)
    numbers = jnp.broadcast_to(jnp.arange(GAMES)[None], (8, GAMES))
    memory = replace(memory, rows=replace(memory.rows, action=numbers), filled=jnp.asarray(8))
    drawn = replay.sample(memory, jax.random.key(0), 4000, 1, 1, 0.9, among=(48, 32)).action
    assert set(drawn.tolist()) == {*range(48, 64), *range(16)}


@pytest.mark.slow
def test_learner_and_exploiter_enter_together_and_the_exploiter_begins_anew(played):
    before, after = played[-3], played[-2]
    for side in ("pursuer", "evader"):
        old, new = getattr(before, side), getattr(after, side)
        assert int(new.archive.count) == int(old.archive.count) + 2
        for place, entered in ((0, old.learner.average), (1, old.exploiter.average)):
            assert same(opponents.version(new.archive, old.archive.count + place), entered)
        assert not same(old.exploiter.average, old.learner.average)
        assert same(new.exploiter.network, old.learner.average)
        assert int(new.exploiter.updates) == 0


@pytest.mark.slow
def test_no_opponent_changes_within_a_game_of_the_league(played):
    """Who sits, the exploiter included, changes only where the games of all seats begin anew."""
    for one, other in pairwise(played):
        seated = np.arange(GAMES) < 4 * 8
        if int(other.iterations) == int(one.iterations):
            assert other.games.state.steps[seated].tolist() == [0] * 32
        else:
            for side in ("pursuer", "evader"):
                assert same(getattr(one, side).archive.seated, getattr(other, side).archive.seated)
                assert int(getattr(other, side).exploiter.updates) >= int(getattr(one, side).exploiter.updates)


@pytest.mark.slow
def test_an_exploiter_learns_as_often_as_the_learner(played):
    """Both began to learn in the third chunk; at the renewal before the fourth, the exploiter's count begins anew."""
    for side in (played[-1].pursuer, played[-1].evader):
        assert int(side.exploiter.updates) == CHUNK // GAMES < int(side.learner.updates)
        assert not same(side.exploiter.network, side.learner.network)
