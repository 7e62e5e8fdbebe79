"""Observations as the page makes them: each is the one of `apollonius.observe`, number by number."""

import shutil

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.agents.network import make_network
from apollonius.agents.store import describe, save_agent
from apollonius.arenas.record import to_dict
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle, wrap_angle
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import GameState, RobotState, Role
from apollonius.observe.registry import OBSERVATIONS
from apollonius.observe.view import look
from tests.web.test_parity import ask

UNEQUAL = Game(
    pursuer=Unicycle(v_max=1.5, u1_max=0.4, u2_max=0.7, radius=0.1),
    evader=Unicycle(v_max=1.0, u1_max=0.2, u2_max=0.9, radius=0.3),
    arena=Arena(-4.0, 8.0, 1.0, 6.0, (Disc(0.0, 3.0, 0.4), Disc(5.5, 4.0, 0.7))),
)
"""Whoever takes one robot, one axis or one disc for the other is found out."""
GAMES = {"paper": make_game("paper"), "unequal": UNEQUAL, "empty": Game(arena=Arena())}


def some_states(game: Game, count: int) -> np.ndarray:
    """Places in and around the walls, a few speeds below 0."""
    rng, arena = np.random.default_rng(1), game.arena
    low = [arena.x_min - 1, arena.y_min - 1, -0.2, -10.0]
    high = [arena.x_max + 1, arena.y_max + 1, 1.6, 10.0]
    states = rng.uniform(low * 2, high * 2, (count, 8)).astype(np.float32)
    states[:, 3::4] = jax.vmap(jax.vmap(wrap_angle))(jnp.asarray(states[:, 3::4]))
    return states


def packages(game: Game, name: str, states: np.ndarray) -> np.ndarray:
    """What the evader sees; the first four numbers of a state are its own."""

    @jax.jit
    @jax.vmap
    def see(row):
        own, opponent = RobotState(*row[:4]), RobotState(*row[4:])
        return OBSERVATIONS[name](look(game, GameState.of_two(opponent, own, jnp.int32(0)), Role.EVADER))

    return np.asarray(see(jnp.asarray(states)))


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
@pytest.mark.parametrize("name", ["paper", "encoded"])
def test_the_pages_observation_is_the_packages(name, tmp_path):
    agent = describe(make_network(name, 4, 1, jax.random.key(0)), Role.EVADER, {}, {})
    save_agent(agent, tmp_path / "agent.safetensors")
    for where, game in GAMES.items():
        states = some_states(game, 1000)
        asked = {"path": str(tmp_path / "agent.safetensors"), "game": to_dict(game), "role": agent.header.role}
        seen = ask(agent=asked, positions=np.roll(states, 4, axis=1).tolist())["observed"]  # the pursuer is first there
        np.testing.assert_allclose(seen, packages(game, name, states), atol=2e-5, err_msg=where)
