"""Policies that drive a course and then play as another player, and a planner that knows them."""

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from half_seconds import AHEAD, HOLD, STEPS, Played, filled, play, repeated, rows_of
from jaxtyping import Array, Int

from apollonius.agents.policy import AbstractPolicy, AbstractWrapper, Memory
from apollonius.agents.source import NamedPlayer
from apollonius.exploit.attack import Attack
from apollonius.exploit.attackers import planner_against
from apollonius.exploit.planner import Planner, Simulation
from apollonius.game.outcome import PURSUER_WINS
from apollonius.game.types import GameState, Outcome, RandomBits, RobotState, Role
from apollonius.observe.view import View

TOGETHER = 8
"""Games in which a planner plans at a time."""


class Begins(AbstractWrapper[AbstractPolicy]):
    """Another player without a memory, after a course."""

    @property
    def memory(self) -> dict[str, Array]:
        """The rest of the course, and the steps in which it is still driven."""
        return {"course": jnp.zeros(STEPS, jnp.int32), "left": jnp.int32(0)}

    def __call__(
        self, view: View, memory: dict[str, Array], bits: RandomBits
    ) -> tuple[Int[Array, ""], dict[str, Array]]:
        action, _ = self.policy(self.policy.observation(view), (), bits)
        left = memory["left"]
        action = jnp.where(left > 0, memory["course"][0], action)
        rest = {"course": jnp.roll(memory["course"], -1), "left": jnp.maximum(left - 1, 0)}
        return action, rest


class KnowingPlanner(Planner):
    """A planner that knows the memories of its opponent, too, in each game."""

    opponent_memories: Memory = None

    def _begin_simulation(self, start: GameState, games: int, courses: int) -> Simulation:
        simulation = super()._begin_simulation(start, games, courses)
        memories = jax.tree.map(
            lambda leaf: jnp.repeat(leaf[:, None], courses, axis=1), self.opponent_memories
        )
        return simulation._replace(opponent_memories=memories)


def make_knowing_planner(attack: Attack, more: int = 1) -> KnowingPlanner:
    """Make the planner against `Begins`; it draws `more` times as many courses as usual."""
    agent = NamedPlayer("course and evader", Begins(attack.player.policy))
    bare = planner_against(agent, Role.EVADER, attack.rules)
    parts = bare.game, bare.opponent, bare.followed, bare.role, more * bare.drawn
    return KnowingPlanner(*parts, bare.steps, bare.every)


@eqx.filter_jit
def plan_and_play(
    planner: KnowingPlanner, played: Played, previous: Int[Array, "games steps"], key: Array
) -> tuple[Played, Int[Array, "games steps"]]:
    """Plan in several games and play half a second; return the rest of the plans, too."""
    games = len(previous)
    bits = jax.random.bits(key, (games,), jnp.uint32)

    def some_plans(rows: tuple[Any, ...]) -> Array:
        robots, memories, previous, bits = rows
        knowing = replace(planner, opponent_memories=memories)
        own, other = robots[planner.role], robots[planner.role.other]
        return knowing.best_course(own, other, previous, bits)

    rows = played.robots, played.memories, previous, bits
    blocks = jax.tree.map(lambda leaf: leaf.reshape(-1, TOGETHER, *leaf.shape[1:]), rows)
    course = jax.lax.map(some_plans, blocks).reshape(games, -1)
    played = play(planner.game, played, course[:, :HOLD], planner.opponent, planner.role)
    rest = jnp.roll(course, -HOLD, axis=1).at[:, -HOLD:].set(course[:, -1:])
    return played, rest


def survive(
    planner: KnowingPlanner,
    robots: tuple[RobotState, RobotState],
    memories: Memory,
    half_seconds: int,
    seed: int,
) -> np.ndarray:
    """Return for how many half seconds each policy survives the planner that knows it.

    Args:
        planner: it knows the policies by their memories.
        robots: the start of all games.
        memories: of each policy.
        half_seconds: after which the games end.
        seed: of the planner's random courses.
    """
    games = len(memories["left"])
    played = Played(repeated(robots, games), jnp.zeros(games, jnp.int32), memories)
    previous = jnp.full((games, planner.steps), AHEAD, jnp.int32)
    lasts = np.full(games, half_seconds)
    numbers = np.arange(games)
    for level in range(half_seconds):
        count = -(-len(numbers) // TOGETHER) * TOGETHER
        rows = filled(np.arange(len(numbers)), count)
        key = jax.random.fold_in(jax.random.key(seed), level)
        played, previous = plan_and_play(
            planner, rows_of(played, rows), rows_of(previous, rows), key
        )
        outcome = np.asarray(played.outcome)[: len(numbers)]
        lost = np.isin(outcome, PURSUER_WINS)
        lasts[numbers[lost]] = level + 1
        ongoing = np.flatnonzero(outcome == Outcome.ONGOING)
        if len(ongoing) == 0:
            break
        numbers = numbers[ongoing]
        played, previous = rows_of(played, ongoing), rows_of(previous, ongoing)
    return lasts
