"""Players that know what the other one does: they follow it through plans of their own, then trust a table."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, Shaped, UInt32

from apollonius.agents.policy import AbstractPolicy, acts_by_chance
from apollonius.agents.pool import act_in_rows
from apollonius.game.by_side import BySide
from apollonius.game.types import NUM_ACTIONS, Action, GameState, Outcome, RobotState
from apollonius.observe.observation import perceive
from apollonius.observe.view import look
from apollonius.solve.joint import interpolate
from apollonius.solve.motion import discount_after
from apollonius.solve.players import AbstractSearch

COURSES = 16
"""Courses of an opponent that acts by chance over which a response takes the mean."""


class RolloutSearch(AbstractSearch):
    """The player that makes most of knowing what the other one does.

    It plans: it holds one action after another, while the opponent, asked again in every step, acts as it does. A plan
    counts by the rules where it ends the game, and by the table otherwise. The best plans of some holds are extended
    (beam search); where none is left out, the search is exhaustive.

    An opponent that acts by chance is asked again and again, each time with random bits of the responder's own: its
    actions count as often as it takes them. The game itself draws other bits.

    Attributes:
        table: what its side is sure of, once it has moved; between nodes an estimate.
        opponent: the other player.
        hold: control steps for which a plan holds an action.
        holds: how many holds a plan has.
        width: most plans that are extended after a hold.
    """

    table: Shaped[Array, "tiles moving lanes"]
    opponent: AbstractPolicy
    hold: int = eqx.field(static=True)
    holds: int = eqx.field(static=True, default=1)
    width: int = eqx.field(static=True, default=NUM_ACTIONS)

    def action_values(
        self, own: RobotState, other: RobotState, bits: UInt32[Array, " games"]
    ) -> Float[Array, "9 games"]:
        """Return the value of each action as the beginning of the best plan; -inf where no such plan was extended.

        Of an opponent that acts by chance it is the mean over `COURSES`, the same ones for each plan.
        """
        states = jax.vmap(GameState.of_two)(*self.zero_sum_game.pair(own, other), jnp.zeros(own.x.shape, jnp.int32))
        one = jax.tree.map(lambda leaf: leaf[0], states)
        chance = acts_by_chance(self.opponent, look(self.zero_sum_game.game, one, self.zero_sum_game.role.other))
        plans = _Plans.none_yet(states, COURSES if chance else 1)
        for number in range(self.holds):
            if number > 0 and self.width < plans.first.shape[1]:
                plans = plans.best(self._values(plans), self.width)
            plans = self._extended(plans, _bits_of_courses(bits, number, self.hold, plans.outcome.shape[2]))
        begins = plans.first[None] == jnp.arange(NUM_ACTIONS)[:, None, None]
        return jnp.max(jnp.where(begins, self._values(plans)[None], -jnp.inf), axis=2)

    def _extended(self, plans: "_Plans", bits: UInt32[Array, "steps games courses"]) -> "_Plans":
        """Return the plans, each with each of the nine actions behind it, carried out."""
        game, role = self.zero_sum_game.game, self.zero_sum_game.role
        longer = jax.tree.map(lambda leaf: jnp.repeat(leaf, NUM_ACTIONS, axis=1), plans)
        shape = longer.outcome.shape
        held = jnp.tile(jnp.arange(NUM_ACTIONS, dtype=jnp.int32), plans.first.shape[1])

        def flat(leaf: Array) -> Array:
            return jnp.broadcast_to(leaf, shape).reshape(-1)

        def stepped(state: GameState, own: Action, other: Action) -> tuple[GameState, Int[Array, ""]]:
            after = game.step(state, *BySide.of(role, own, other).pair)
            return after.state, after.outcome

        def one_step(
            before: tuple[GameState, Int[Array, "games plans courses"]], bits: UInt32[Array, "games courses"]
        ) -> tuple[tuple[GameState, Int[Array, "games plans courses"]], None]:
            states = jax.tree.map(flat, before[0])
            # All plans in a game meet the same courses of an opponent that acts by chance.
            read, rows = perceive(self.opponent.observation, game, states, role.other)
            answers, _ = act_in_rows(self.opponent, read, rows, (), flat(bits[:, None]))
            after = jax.vmap(stepped)(states, flat(held[None, :, None]), answers)
            ongoing = before[1] == Outcome.ONGOING
            return jax.tree.map(lambda new, old: jnp.where(ongoing, new.reshape(shape), old), after, before), None

        (states, outcome), _ = jax.lax.scan(one_step, (longer.states, longer.outcome), bits)
        first = longer.first if plans.first.shape[1] > 1 else jnp.broadcast_to(held, longer.first.shape)
        return _Plans(first, states, outcome)

    def _values(self, plans: "_Plans") -> Float[Array, "games plans"]:
        """Return the value of each plan, where it ends the game by the rules and by the table otherwise."""
        zero_sum_game, (grid, other_grid) = self.zero_sum_game, self.zero_sum_game.grids
        flat = jax.tree.map(lambda leaf: leaf.reshape(-1), plans.states)
        own, other = zero_sum_game.pair(flat.pursuer, flat.evader)
        here = jax.tree.map(lambda leaf: leaf[None], own)
        later = interpolate(self.table, (other_grid, other), (grid, here)).reshape(plans.outcome.shape)
        seconds = plans.states.steps.astype(jnp.float32) * zero_sum_game.game.dt
        ended = zero_sum_game.payoff_of(plans.outcome, seconds)
        return jnp.mean(jnp.where(plans.outcome == Outcome.ONGOING, discount_after(seconds) * later, ended), axis=2)


class _Plans(eqx.Module):
    """Plans in several games, each followed through several courses of the opponent.

    Attributes:
        first: the action that a plan begins with.
        states: where they lead, with the steps taken, leaves `[games plans courses]`.
        outcome: of the game then; one that is over stays as it ended.
    """

    first: Int[Array, "games plans"]
    states: GameState
    outcome: Int[Array, "games plans courses"]

    @classmethod
    def none_yet(cls, states: GameState, courses: int) -> "_Plans":
        """Return one plan that does nothing, for each game."""
        repeated = jax.tree.map(lambda leaf: jnp.repeat(leaf[:, None, None], courses, axis=2), states)
        ongoing = jnp.full(repeated.steps.shape, int(Outcome.ONGOING), jnp.int32)
        return cls(jnp.zeros((len(states.steps), 1), jnp.int32), repeated, ongoing)

    def best(self, values: Float[Array, "games plans"], width: int) -> "_Plans":
        """Return those of the greatest values."""
        _, kept = jax.lax.top_k(values, width)
        return jax.tree.map(lambda leaf: jax.vmap(lambda plans, kept: plans[kept])(leaf, kept), self)


def _bits_of_courses(
    bits: UInt32[Array, " games"], hold: int, steps: int, courses: int
) -> UInt32[Array, "steps games courses"]:
    """Return random bits for each course of each game in a hold, from one for each game; 0 where there is no chance."""
    if courses == 1:
        return jnp.zeros((steps, *bits.shape, 1), jnp.uint32)

    def of_game(bits: UInt32[Array, ""]) -> UInt32[Array, "steps courses"]:
        return jax.random.bits(jax.random.fold_in(jax.random.key(bits), hold), (steps, courses), jnp.uint32)

    return jax.vmap(of_game, out_axes=1)(bits)
