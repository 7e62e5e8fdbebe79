"""Small untrained agents in games that differ in everything a policy has built in, and states to decide in."""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from apollonius.adapters.export.blueprint import Blueprint, make_blueprint
from apollonius.agents.network import GaussianActor, QNetwork, make_actor, make_network
from apollonius.agents.store import describe
from apollonius.agents.trained import greedy
from apollonius.arenas.record import to_dict
from apollonius.game.arena import Arena, Disc
from apollonius.game.dynamics import Unicycle, wrap_angle
from apollonius.game.game import Game
from apollonius.game.presets import make_game
from apollonius.game.types import RobotState, Role
from apollonius.observe.view import Robot, View

UNEQUAL = Game(
    pursuer=Unicycle(v_max=1.5, u1_max=0.4, u2_max=0.7, radius=0.1),
    evader=Unicycle(v_max=1.0, u1_max=0.2, u2_max=0.9, radius=0.3),
    arena=Arena(-4.0, 8.0, 1.0, 6.0, (Disc(0.0, 3.0, 0.4), Disc(5.5, 4.0, 0.7))),
)
"""Whoever takes one robot, one axis or one disc for the other is found out."""
EMPTY = Game(arena=Arena())
GAMES = {"paper": make_game("paper"), "unequal": UNEQUAL, "empty": EMPTY}
PLAYED = [
    ("encoded", "paper", Role.PURSUER),
    ("encoded", "unequal", Role.PURSUER),
    ("encoded", "unequal", Role.EVADER),
    ("encoded", "empty", Role.EVADER),
    ("paper", "unequal", Role.PURSUER),
    ("paper", "unequal", Role.EVADER),
]
DISCRETE, CONTINUOUS = ([(kind, *played) for played in PLAYED] for kind in ("discrete", "continuous"))
ONE_OF_EACH_PROFILE = [DISCRETE[1], DISCRETE[5]]
ONE_OF_EACH = [*ONE_OF_EACH_PROFILE, CONTINUOUS[1], CONTINUOUS[5]]


@dataclass(frozen=True)
class Case:
    """A policy, and what the package's player sees and does in some states: actions or gears, and their controls."""

    blueprint: Blueprint
    states: np.ndarray
    observations: np.ndarray
    actions: np.ndarray
    controls: np.ndarray


def small_network(profile: str, seed: int = 0) -> QNetwork:
    """Weights so large, and values so level, that a small error of the observation often changes the choice."""
    network = make_network(profile, width=21, depth=2, key=jax.random.key(seed))
    return jax.tree.map(lambda leaf: 4 * leaf, network)


def small_actor(profile: str, seed: int = 0) -> GaussianActor:
    """Weights so large that gears are anywhere, but not so large that nearly all are at an end."""
    actor = make_actor(profile, width=21, depth=2, key=jax.random.key(seed))
    return jax.tree.map(lambda leaf: 2 * leaf, actor)


def some_states(game: Game, count: int) -> np.ndarray:
    """Places in and around the walls, a few speeds below 0, headings within three turns."""
    rng, arena = np.random.default_rng(1), game.arena
    low = [arena.x_min - 1, arena.y_min - 1, -0.2, -10.0]
    high = [arena.x_max + 1, arena.y_max + 1, 1.6, 10.0]
    return rng.uniform(low * 2, high * 2, (count, 8)).astype(np.float32)


@pytest.fixture(scope="session", params=DISCRETE, ids=lambda case: "-".join(map(str, case)))
def case(request):
    """One policy of many kinds."""
    kind, profile, name, role = request.param
    game, network = GAMES[name], (small_network if kind == "discrete" else small_actor)(profile)
    blueprint = make_blueprint("small", describe(network, role, to_dict(game), {}), game)
    bodies = (game.pursuer, game.evader) if role == Role.PURSUER else (game.evader, game.pursuer)

    @jax.jit
    @jax.vmap
    def play(state):
        own, opponent = (
            eqx.tree_at(lambda robot: robot.heading, robot, wrap_angle(robot.heading))
            for robot in (RobotState(*state[:4]), RobotState(*state[4:]))
        )
        robots = Robot(bodies[0], own), (), (Robot(bodies[1], opponent),)
        seen = network.observation(View(game.arena, *robots, game.capture_distance))
        action = greedy(network)(seen, jnp.uint32(0))
        return seen, action, jnp.stack(bodies[0].controls(action))

    states = some_states(game, 400)
    return Case(blueprint, states, *map(np.asarray, play(jnp.asarray(states))))
