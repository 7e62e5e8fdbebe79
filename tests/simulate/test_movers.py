"""Movers among robots with bodies: seen, judged and recorded where they are; robots at rest may be walked into."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.classical import Still
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import single_player
from apollonius.game.arena import Arena
from apollonius.game.movers import Movers
from apollonius.game.presets import make_game
from apollonius.game.timetable import Shuttle
from apollonius.game.types import BySide, MoverMotion, Outcome
from apollonius.game.walkers import Walkers
from apollonius.play.replay import as_state, load_replay, save_replay
from apollonius.simulate.drive import RobotHardware
from apollonius.simulate.simulation import record_course, simulate
from tests.acting import a_match

pytest.importorskip("mujoco", reason="needs mujoco: pip install mujoco")
SHUTTLE = Shuttle(((2.0, 5.0), (8.0, 5.0)), radius=0.3, v_max=1.0, a_max=100.0)
PAPER = replace(make_game("paper"), arena=Arena(), max_steps=60)
GAME = replace(PAPER, pursuer=replace(PAPER.pursuer, radius=0.2), movers=Movers((SHUTTLE,)))


class GoesOn(AbstractPolicy):
    """Speeds up straight on."""

    def __call__(self, seen, memory, bits):
        return jnp.int32(7), memory


class StopsAtLast(AbstractPolicy):
    """Speeds up straight on for 5 steps, then brakes."""

    @property
    def memory(self):
        return jnp.int32(0)

    def __call__(self, seen, memory, bits):
        return jnp.where(memory < 5, 7, 1).astype(jnp.int32), memory + 1


class Flinches(AbstractPolicy):
    """Turns in its place while the nearest mover is within 1.5 m."""

    def __call__(self, seen, memory, bits):
        motion, own = seen.movers.motion, seen.own.state
        near = jnp.min(jnp.hypot(motion.x - own.x, motion.y - own.y)) < 1.5
        return jnp.where(near, 5, 4).astype(jnp.int32), memory


def started(game, *row):
    """The start of one game in which the shuttle, if there is one, is at its first waypoint."""
    places = as_state(jnp.asarray(row, jnp.float32), jnp.asarray(0))
    movers = game.reset(jax.random.key(3)).movers
    if game.movers.shuttles:
        motion = MoverMotion(*(jnp.array([value], jnp.float32) for value in (2, 5, 0, 0)))
        movers = replace(movers, clocks=jnp.zeros(1), motion=motion)
    return jax.tree.map(lambda leaf: leaf[None], replace(places, movers=movers))


def simulated(game, pursuer, *row):
    players = BySide(single_player(pursuer), single_player(Still()))
    return simulate(game, players, started(game, *row), jax.random.key(0), RobotHardware())


def replayed(game, found, pursuer, tmp_path):
    """One game as it was recorded, and written to a file."""
    save_replay(record_course(found, a_match(game, pursuer, Still(), 1), 0), tmp_path / "game.json")
    return load_replay(tmp_path / "game.json")


def test_body_that_drives_into_a_mover_fails(tmp_path):
    """Northwards across the way of the shuttle, which reaches it after 2.5 s."""
    found = simulated(GAME, GoesOn(), 5.0, 4.0, 0.0, np.pi / 2, 1.0, 1.0, 0.0, 0.0)
    assert int(found.results.outcome[0]) == Outcome.PURSUER_HIT_OBSTACLE
    replay = replayed(GAME, found, GoesOn(), tmp_path)
    gaps = np.hypot(*(replay.mover_places()[:, 0] - replay.states[:, :2]).T) - 0.5
    assert gaps[-1] < 0
    assert (gaps[:-1] > 0).all()


@pytest.mark.parametrize(("pursuer", "x"), [(Still(), 5.0), (StopsAtLast(), 4.8)])
def test_body_at_rest_may_be_walked_into(pursuer, x, tmp_path):
    """One that stood, and one whose drive has come to rest."""
    found = simulated(GAME, pursuer, x, 5.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0)
    assert int(found.results.outcome[0]) == Outcome.NO_RESULT
    replay = replayed(GAME, found, pursuer, tmp_path)
    gaps = np.hypot(*(replay.mover_places()[:, 0] - replay.states[:, :2]).T) - 0.5
    assert gaps.min() < -0.4
    assert (replay.states[gaps < 0, 2] == 0).all()
    assert np.ptp(replay.states[gaps < 0, :2], axis=0).max() < 0.01, "it is not pushed"


def test_players_see_movers_where_the_replay_shows_them(tmp_path):
    """And walkers keep away from the bodies."""
    game = replace(PAPER, movers=Movers(walkers=(Walkers(4),)), max_steps=150)
    found = simulated(game, Flinches(), 5.0, 5.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0)
    replay = replayed(game, found, Flinches(), tmp_path)
    away = np.hypot(*np.moveaxis(replay.mover_places() - replay.states[:, None, :2], 2, 0)).min(axis=1)
    near = away[:-1] < 1.5
    assert 10 < near.sum() < 140
    np.testing.assert_array_equal(replay.actions[:, 0], np.where(near, 5, 4))
    assert away.min() > 0.25
