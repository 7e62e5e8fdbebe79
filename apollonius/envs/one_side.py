"""Many games seen from one side, in one compiled call: pure functions of how they stand and of a pile of starts."""

import functools
import operator
from dataclasses import dataclass, replace
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from gymnasium.vector import AutoresetMode
from jaxtyping import Array, Bool, Float, Int, UInt32

from apollonius.agents.disturbance import NONE
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.pool import solo
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.types import Actions, GameState, Role, Timestep
from apollonius.observe.observation import AbstractObservation, perceive
from apollonius.play.rollout import SideState, begin_side, decide, of_robots

Tree = TypeVar("Tree")
SideActions = Int[Array, "games *robots"] | Float[Array, "games *robots 2"]
"""What one side does in every game: of a team there is an axis of robots."""
SPARE = 4
"""Starts are drawn beforehand, for this many times the number of games at once."""
_TOGETHER = 512
"""Starts that are drawn together until all fit: with more, more draws would be in vain."""


@dataclass(frozen=True)
class OneSideSetup:
    """What stays the same from step to step.

    Attributes:
        game: the rules.
        role: the side from outside.
        observation: what it sees.
        opponent: plays the other side.
        num_envs: number of games.
        autoreset_mode: when a game that has ended begins again.
    """

    game: Game
    role: Role
    observation: AbstractObservation
    opponent: AbstractPolicy
    num_envs: int
    autoreset_mode: AutoresetMode

    @property
    def robots(self) -> BySide[int]:
        return self.game.bodies.map(len)

    def see(self, state: GameState) -> Float[Array, "games *robots size"]:
        """Return the observations of the side from outside."""
        _, seen = perceive(self.observation, self.game, state, self.role)
        return of_robots(jnp.split(seen, self.robots[self.role]))

    def answer(self, now: "Standing", bits: UInt32[Array, ""]) -> tuple[tuple[Actions, ...], SideState]:
        """Return what each robot of the opponent does, and what it carries on."""
        bits = jax.random.bits(jax.random.key(bits), (self.num_envs,), jnp.uint32)
        seen = perceive(self.opponent.observation, self.game, now.state, self.role.other)
        actions, memory = decide(solo(self.opponent), now.opponent, seen, bits)
        return actions, replace(now.opponent, memory=memory)

    def begin(self, state: GameState) -> "Standing":
        """Return games as they stand at their starts."""
        bits, robots = jnp.zeros(len(state.steps), jnp.uint32), self.robots[self.role.other]
        opponent = begin_side(jnp.zeros(bits.shape, jnp.int32), bits, NONE, robots, self.opponent.memory)
        return Standing(state, self.see(state), opponent)

    def each(self, actions: SideActions) -> tuple[Actions, ...]:
        """Return the action of each robot from outside; for several, actions have an axis of robots."""
        several = self.robots[self.role] > 1
        return tuple(actions[:, number] for number in range(actions.shape[1])) if several else (actions,)


class Standing(eqx.Module):
    """Games under way, the observations of the side from outside, and the opponent's memory."""

    state: GameState
    seen: Float[Array, "games *robots size"]
    opponent: SideState


class StepResult(eqx.Module):
    """The results of a step of every game; `led_to` is what was seen before any new game.

    `reward` is the mean of the robots' rewards. In games of teams there is also each robot's own, and its status.
    """

    led_to: Float[Array, "games *robots size"]
    reward: Float[Array, " games"]
    terminated: Bool[Array, " games"]
    truncated: Bool[Array, " games"]
    outcome: Int[Array, " games"]
    rewards: Float[Array, "games robots"] | None = None
    status: Int[Array, "games robots"] | None = None


def sample_starts(setup: OneSideSetup, bits: UInt32[Array, ""]) -> Standing:
    """A pile of starts."""
    keys = jax.random.split(jax.random.key(bits), SPARE * setup.num_envs)
    starts = jax.lax.map(setup.game.reset, keys, batch_size=_TOGETHER)
    return setup.begin(starts)


def step_games(
    setup: OneSideSetup, now: Standing, ended: Bool[Array, " games"], starts: Standing, used: Int[Array, ""],
    action: SideActions, bits: UInt32[Array, ""],
) -> tuple[Standing, StepResult]:  # fmt: skip
    """One step of every game; those that have `ended` before do not count where they begin again in this step."""
    answer, opponent = setup.answer(now, bits)
    actions = BySide.of(setup.role, setup.each(action), answer)
    after = jax.vmap(setup.game.step)(now.state, *actions.pair)
    led_to = Standing(after.state, setup.see(after.state), opponent)
    result = _result(setup, led_to, after)
    match setup.autoreset_mode:
        case AutoresetMode.SAME_STEP:
            return renew(led_to, starts, used, result.terminated | result.truncated), result
        case AutoresetMode.NEXT_STEP:
            # Zeros: no reward, no end, an ongoing game, active robots.
            begun = replace(jax.tree.map(jnp.zeros_like, result), led_to=led_to.seen)
            return renew(led_to, starts, used, ended), _choose(ended, begun, result)
        case AutoresetMode.DISABLED:
            return led_to, result


def _result(setup: OneSideSetup, led_to: Standing, after: Timestep) -> StepResult:
    rewards, status = after.rewards[setup.role], led_to.state.status
    reward = functools.reduce(operator.add, rewards) / len(rewards)
    result = StepResult(led_to.seen, reward, after.terminated, after.truncated, after.outcome)
    if status is None:
        return result
    return replace(result, rewards=jnp.stack(rewards, axis=1), status=jnp.stack(status[setup.role], axis=1))


def renew(now: Standing, starts: Standing, used: Int[Array, ""], resets: Bool[Array, " games"]) -> Standing:
    """Return games, some restarted from the first unused starts."""
    row = jnp.where(resets, used + jnp.cumsum(resets.astype(jnp.int32)) - 1, 0)
    return _choose(resets, jax.tree.map(lambda leaf: leaf[row], starts), now)


def _choose(which: Bool[Array, " games"], one: Tree, other: Tree) -> Tree:
    """Of some games the one record, of the rest the other."""
    return jax.tree.map(lambda a, b: jnp.where(which.reshape(-1, *[1] * (a.ndim - 1)), a, b), one, other)
