"""Players of the two-robot game that act by a solved table: they look one hold or some ahead, again
in every step.

Against an unknown opponent the table's value counts; a known one is followed through plans before
it does.
"""

from abc import abstractmethod
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, Shaped, UInt32

from apollonius.accelerate.batch_rule import broadcast_rows, with_batch_function
from apollonius.agents.policy import AbstractActionValuePolicy, AbstractPolicy, Memory
from apollonius.agents.pool import ActionsAndMemory, RowBits, act_in_rows
from apollonius.game.game import Game
from apollonius.game.types import (
    NUM_ACTIONS,
    Action,
    Actions,
    BySide,
    GameState,
    Outcome,
    RandomBits,
    RobotState,
    Role,
)
from apollonius.observe.knowledge import Knowledge
from apollonius.observe.observation import observation_rows
from apollonius.observe.view import View
from apollonius.solve.joint import interpolate
from apollonius.solve.motion import (
    ZeroSumGame,
    discount_after,
    end_state,
    every_hold,
    first_events,
    payoff_of,
)

Values = Float[Array, "9 games"]
"""The values of the nine actions in several games."""


class AbstractSearch(AbstractActionValuePolicy):
    """A player that holds each of its actions by the rules and judges by what comes after."""

    zero_sum_game: ZeroSumGame

    def values(self, view: View) -> Float[Array, "9"]:
        return self.score(view, (), jnp.zeros((), jnp.uint32))[0]

    def score(
        self, view: View, memory: Memory, bits: RandomBits
    ) -> tuple[Float[Array, "9"], Memory]:
        """Return the values against an opponent that acts by chance, as by these bits."""
        return _values_in_one(self, view.own.state, view.opponent.state, bits), memory

    @eqx.filter_jit
    def best_value(self, states: GameState) -> Float[Array, " games"]:
        """Estimate the value for its side of several states of the game, leaves `[games]`."""
        own, other = self.zero_sum_game.pair(states.pursuer, states.evader)
        return jnp.max(self.action_values(own, other, jnp.zeros(own.x.shape, jnp.uint32)), axis=0)

    @abstractmethod
    def action_values(
        self, own: RobotState, other: RobotState, bits: UInt32[Array, " games"]
    ) -> Values:
        """Return the values of the nine actions in several games, against chance by these bits."""


def _values_in_many(
    size: int, batched: Any, player: AbstractSearch, *views: Any
) -> Float[Array, "games 9"]:
    return player.action_values(*broadcast_rows(size, tuple(batched[1:]), views)).T


@with_batch_function(_values_in_many)
def _values_in_one(
    player: AbstractSearch, own: RobotState, other: RobotState, bits: RandomBits
) -> Float[Array, "9"]:
    """Return the values of the nine actions in one game; a batch of games is looked at together."""
    one_game = jax.tree.map(lambda leaf: leaf[None], (own, other, bits))
    return player.action_values(*one_game)[:, 0]


class SaddlePolicy(AbstractSearch):
    """The player of either side that makes most of the value that the table of `solve_duel`
    promises it.
    """

    table: Shaped[Array, "tiles moving lanes"]

    def action_values(
        self, own: RobotState, other: RobotState, bits: UInt32[Array, " games"]
    ) -> Values:
        """Return the value of each action against the answer that is worst for it.

        An answer counts by the rules where it ends the game within the hold, and by the table
        otherwise.
        """
        game, (grid, other_grid) = self.zero_sum_game, self.zero_sum_game.grids
        own_motion, other_motion = game.motions
        own_courses = every_hold(own_motion, own)
        other_courses = every_hold(other_motion, other)
        outcome, seconds = first_events(game.game, *game.pair(own_courses, other_courses))
        if game.role == Role.EVADER:
            outcome, seconds = jnp.swapaxes(outcome, 0, 1), jnp.swapaxes(seconds, 0, 1)
        later = game.motions[0].discount * interpolate(
            self.table, (other_grid, other), (grid, end_state(own_courses))
        )
        values = jnp.where(
            outcome == Outcome.ONGOING, later[:, None], payoff_of(game.role, outcome, seconds)
        )
        return jnp.min(values, axis=1)


class RolloutSearch(AbstractSearch):
    """The player that makes most of knowing what the other one does.

    It plans: it holds one action after another, while the opponent, asked again in every step, acts
    as it does. A plan counts by the rules where it ends the game, and by the table otherwise. The
    best plans of some holds are extended (beam search); where none is left out, the search is
    exhaustive.

    An opponent that acts by chance is followed along one course, with random bits of the searching
    player's own. The game itself draws other bits. The table is as of a `SaddlePolicy`. A plan has
    some `holds`, each of `hold` control steps, after which `width` plans are extended at most.
    """

    table: Shaped[Array, "tiles moving lanes"]
    opponent: AbstractPolicy
    hold: int = eqx.field(static=True)
    holds: int = eqx.field(static=True, default=1)
    width: int = eqx.field(static=True, default=NUM_ACTIONS)

    def action_values(
        self, own: RobotState, other: RobotState, bits: UInt32[Array, " games"]
    ) -> Values:
        """Return the value of each action as the beginning of the best plan; -inf where no such
        plan was extended.
        """
        robots = jax.tree.map(lambda leaf: leaf[:, None], self.zero_sum_game.pair(own, other))
        steps = jnp.zeros(robots.pursuer.x.shape, jnp.int32)
        states = jax.vmap(jax.vmap(GameState.of_two))(*robots, steps=steps)
        plans = _Plans(
            jnp.zeros_like(states.steps), states, jnp.full_like(states.steps, int(Outcome.ONGOING))
        )
        for number in range(self.holds):
            if number > 0 and self.width < plans.first.shape[1]:
                plans = select_courses(plans, jax.lax.top_k(self._values(plans), self.width)[1])

            def hold_bits(bits: RandomBits, number: int = number) -> UInt32[Array, " steps"]:
                key = jax.random.fold_in(jax.random.key(bits), number)
                return jax.random.bits(key, (self.hold,), jnp.uint32)

            plans = self._extend(plans, jax.vmap(hold_bits, out_axes=1)(bits))
        begins_with = plans.first[None] == jnp.arange(NUM_ACTIONS)[:, None, None]
        return jnp.max(jnp.where(begins_with, self._values(plans)[None], -jnp.inf), axis=2)

    def _extend(self, plans: "_Plans", bits: UInt32[Array, "steps games"]) -> "_Plans":
        """Return the plans, each with each of the nine actions behind it, carried out."""
        game, role = self.zero_sum_game.game, self.zero_sum_game.role
        longer = jax.tree.map(lambda leaf: jnp.repeat(leaf, NUM_ACTIONS, axis=1), plans)
        shape = longer.outcome.shape
        actions = jnp.tile(jnp.arange(NUM_ACTIONS, dtype=jnp.int32), plans.first.shape[1])

        def flat(leaf: Array) -> Array:
            return jnp.broadcast_to(leaf, shape).reshape(-1)

        def one_step(
            before: tuple[GameState, Int[Array, "games plans"]], bits: UInt32[Array, " games"]
        ) -> tuple[tuple[GameState, Int[Array, "games plans"]], None]:
            states = jax.tree.map(flat, before[0])
            # All plans in a game meet the same course of an opponent that acts by chance.
            answers, _ = batch_actions(
                self.opponent, game, states, role.other, (), flat(bits[:, None])
            )
            return step_courses(game, role, *before, flat(actions[None]), answers), None

        (states, outcome), _ = jax.lax.scan(one_step, (longer.states, longer.outcome), bits)
        is_first_hold = plans.first.shape[1] == 1
        first = jnp.broadcast_to(actions, longer.first.shape) if is_first_hold else longer.first
        return _Plans(first, states, outcome)

    def _values(self, plans: "_Plans") -> Float[Array, "games plans"]:
        """Return the value of each plan, where it ends the game by the rules and by the table
        otherwise.
        """
        zero_sum_game, (grid, other_grid) = self.zero_sum_game, self.zero_sum_game.grids
        flat = jax.tree.map(lambda leaf: leaf.reshape(-1), plans.states)
        own, other = zero_sum_game.pair(flat.pursuer, flat.evader)
        own_row = jax.tree.map(lambda leaf: leaf[None], own)
        later = interpolate(self.table, (other_grid, other), (grid, own_row)).reshape(
            plans.outcome.shape
        )
        seconds = plans.states.steps.astype(jnp.float32) * zero_sum_game.game.dt
        payoff = payoff_of(zero_sum_game.role, plans.outcome, seconds)
        return jnp.where(plans.outcome == Outcome.ONGOING, discount_after(seconds) * later, payoff)


def batch_actions(
    policy: AbstractPolicy, game: Game, states: GameState, role: Role, memory: Memory, bits: RowBits
) -> ActionsAndMemory:
    """Return a player's actions in a batch of states, and its memories after them.

    Args:
        policy: the player.
        game: the rules.
        states: leaves `[rows]`.
        role: the player's side.
        memory: its memory in each row.
        bits: random bits of each row.
    """
    read, rows = observation_rows(policy.observation, game, Knowledge.complete(states), role)
    return act_in_rows(policy, read, rows, memory, bits)


def select_courses(tree: Any, courses: Int[Array, "games some"]) -> Any:
    """Return some courses of each game, of leaves `[games, courses, ...]`."""
    return jax.tree.map(
        lambda leaf: jax.vmap(lambda leaf, courses: leaf[courses])(leaf, courses), tree
    )


def step_courses(
    game: Game,
    role: Role,
    states: GameState,
    outcome: Int[Array, "starts n"],
    own: Actions,
    other: Actions,
) -> tuple[GameState, Int[Array, "starts n"]]:
    """Play several courses of each game one step; those that are over stay as they are.

    Args:
        game: the rules.
        role: the side of the own actions.
        states: leaves `[starts, n]`.
        outcome: of each course so far.
        own, other: actions of both sides, `[starts * n]`, all courses of the first game first.
    """

    def step_one(state: GameState, own: Action, other: Action) -> tuple[GameState, Int[Array, ""]]:
        after = game.step(state, *BySide.of(role, own, other))
        return after.state, after.outcome

    after = jax.vmap(step_one)(jax.tree.map(jnp.ravel, states), own, other)
    ongoing = outcome == Outcome.ONGOING
    in_games = jax.tree.map(lambda leaf: leaf.reshape(outcome.shape), after)
    return jax.tree.map(lambda new, old: jnp.where(ongoing, new, old), in_games, (states, outcome))


class _Plans(eqx.Module):
    """Plans in several games: their first action, and state and outcome at their end, or at the end
    of the game.
    """

    first: Int[Array, "games plans"]
    states: GameState
    outcome: Int[Array, "games plans"]
