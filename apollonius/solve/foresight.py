"""Players that know what the other one does: they follow it through plans of their own, then trust a table."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, Shaped, UInt32

from apollonius.agents.policy import AbstractPolicy, acts_by_chance
from apollonius.agents.pool import act_in_rows
from apollonius.game.by_side import BySide
from apollonius.game.types import NUM_ACTIONS, Action, GameState, Outcome, RobotState
from apollonius.observe.observation import perceive
from apollonius.observe.view import View, look
from apollonius.solve.joint import interpolate
from apollonius.solve.motion import discount_after
from apollonius.solve.players import AbstractLookahead
from apollonius.solve.zero_sum_game import ZeroSumGame

COURSES = 16
"""Courses of an opponent that acts by chance over which a response takes the mean."""


class ResponsePolicy(AbstractLookahead):
    """The player that makes most of knowing what the other one does.

    It plans: it holds one action after another, while the opponent, asked anew in every step, goes on as it does. A
    plan counts by the rules where it ends the game, and by the table otherwise. Of all plans of some holds the best are
    gone on from (beam search); where none is left out, that is all there is to be had in so many seconds.

    An opponent that acts by chance is asked again and again, each time with random bits of the responder's own: its
    actions count as often as it takes them. What it then does in the game is drawn anew.

    Attributes:
        table: what its side is sure of, once it has moved; between nodes an estimate.
        opponent: the other player.
        hold: control steps for which a plan holds an action; None for as many as the table does.
        holds: how many holds a plan has.
        width: most plans that are gone on from after a hold.
    """

    table: Shaped[Array, "tiles moving lanes"]
    opponent: AbstractPolicy
    hold: int | None = eqx.field(static=True, default=None)
    holds: int = eqx.field(static=True, default=1)
    width: int = eqx.field(static=True, default=NUM_ACTIONS)

    @property
    def steps(self) -> int:
        return self.hold or self.zero_sum_game.motions[0].steps

    def action_values(
        self, own: RobotState, other: RobotState, bits: UInt32[Array, " games"]
    ) -> Float[Array, "9 games"]:
        """What each action is worth as the beginning of the best plan; -inf where no plan was gone on from.

        Of an opponent that acts by chance it is the mean over `COURSES`, the same ones for each plan.
        """
        states = jax.vmap(GameState.of_two)(*self.zero_sum_game.pair(own, other), jnp.zeros(own.x.shape, jnp.int32))
        courses = COURSES if answers_by_chance(self.zero_sum_game, self.opponent) else 1
        plans = _Plans.none_yet(states, courses)
        for number in range(self.holds):
            begun = plans.best(self._worth(plans), self.width) if number > 0 else plans
            drawn = _bits_of_courses(bits, number, self.steps, courses)
            plans = self._followed(begun.one_hold_more(), drawn)
        begins = plans.first[None] == jnp.arange(NUM_ACTIONS)[:, None, None]
        return jnp.max(jnp.where(begins, self._worth(plans)[None], -jnp.inf), axis=2)

    def _followed(self, plans: "_Plans", bits: UInt32[Array, "steps games courses"]) -> "_Plans":
        """The plans, with the actions that they hold last carried out."""
        game, role, shape = self.zero_sum_game.game, self.zero_sum_game.role, plans.outcome.shape

        def flat(leaf: Array) -> Array:
            return jnp.broadcast_to(leaf, shape).reshape(-1)

        def stepped(state: GameState, own: Action, other: Action) -> tuple[GameState, Int[Array, ""]]:
            after = game.step(state, *BySide.of(role, own, other).pair)
            return after.state, after.outcome

        def go_on(plans: "_Plans", bits: UInt32[Array, "games courses"]) -> tuple["_Plans", None]:
            states = jax.tree.map(flat, plans.states)
            # All plans in a game meet the same courses of an opponent that acts by chance.
            read, rows = perceive(self.opponent.observation, game, states, role.other)
            answers, _ = act_in_rows(self.opponent, read, rows, (), flat(bits[:, None]))
            after, outcome = jax.vmap(stepped)(states, flat(plans.held[..., None]), answers)
            there = jax.tree.map(lambda leaf: leaf.reshape(shape), after)
            return plans.then(there, outcome.reshape(shape)), None

        return jax.lax.scan(go_on, plans, bits)[0]

    def _worth(self, plans: "_Plans") -> Float[Array, "games plans"]:
        zero_sum_game, (grid, other_grid) = self.zero_sum_game, self.zero_sum_game.grids
        flat = jax.tree.map(lambda leaf: leaf.reshape(-1), plans.states)
        own, other = zero_sum_game.pair(flat.pursuer, flat.evader)
        here = jax.tree.map(lambda leaf: leaf[None], own)
        later = interpolate(self.table, (other_grid, other), (grid, here)).reshape(plans.outcome.shape)
        seconds = plans.states.steps.astype(jnp.float32) * zero_sum_game.game.dt
        ended = zero_sum_game.payoff_of(plans.outcome, seconds)
        return jnp.mean(jnp.where(plans.ongoing, discount_after(seconds) * later, ended), axis=2)


class _Plans(eqx.Module):
    """Plans in several games, each followed through several courses of the opponent.

    Attributes:
        first, held: the actions that a plan begins with and that it holds last.
        states: where they lead, with the steps taken, leaves `[games plans courses]`.
        outcome: how the game then stands; one that is over stays as it ended.
    """

    first: Int[Array, "games plans"]
    held: Int[Array, "games plans"]
    states: GameState
    outcome: Int[Array, "games plans courses"]

    @classmethod
    def none_yet(cls, states: GameState, courses: int) -> "_Plans":
        """One plan that does nothing, for each game."""
        nothing = jnp.zeros((len(states.steps), 1), jnp.int32)
        repeated = jax.tree.map(lambda leaf: jnp.repeat(leaf[:, None, None], courses, axis=2), states)
        return cls(nothing, nothing, repeated, jnp.full(repeated.steps.shape, int(Outcome.ONGOING), jnp.int32))

    @property
    def ongoing(self) -> Bool[Array, "games plans courses"]:
        return self.outcome == Outcome.ONGOING

    def one_hold_more(self) -> "_Plans":
        """Each plan with each of the nine actions behind it."""
        plans = self.first.shape[1]
        longer = jax.tree.map(lambda leaf: jnp.repeat(leaf, NUM_ACTIONS, axis=1), self)
        held = jnp.broadcast_to(jnp.tile(jnp.arange(NUM_ACTIONS, dtype=jnp.int32), plans), longer.held.shape)
        first = held if plans == 1 else longer.first
        return replace(longer, held=held, first=first)

    def then(self, states: GameState, outcome: Int[Array, "games plans courses"]) -> "_Plans":
        """The same one step on."""
        went_on = jax.tree.map(lambda new, old: jnp.where(self.ongoing, new, old), states, self.states)
        return replace(self, states=went_on, outcome=jnp.where(self.ongoing, outcome, self.outcome))

    def best(self, worth: Float[Array, "games plans"], width: int) -> "_Plans":
        """Those of the greatest worth."""
        if width >= worth.shape[1]:
            return self
        _, kept = jax.lax.top_k(worth, width)

        def of_kept(leaf: Array) -> Array:
            index = kept.reshape(*kept.shape, *(1,) * (leaf.ndim - 2))
            return jnp.take_along_axis(leaf, index, axis=1)

        return jax.tree.map(of_kept, self)


def _bits_of_courses(
    bits: UInt32[Array, " games"], hold: int, steps: int, courses: int
) -> UInt32[Array, "steps games courses"]:
    """Random bits for each course of each game in a hold, from one for each game; all 0 where there is no chance."""
    if courses == 1:
        return jnp.zeros((steps, *bits.shape, 1), jnp.uint32)

    def of_game(bits: UInt32[Array, ""]) -> UInt32[Array, "steps courses"]:
        return jax.random.bits(jax.random.fold_in(jax.random.key(bits), hold), (steps, courses), jnp.uint32)

    return jax.vmap(of_game, out_axes=1)(bits)


def answer_of(
    zero_sum_game: ZeroSumGame, opponent: AbstractPolicy, own: RobotState, other: RobotState, bits: UInt32[Array, ""]
) -> Action:
    """The action that the opponent takes, from the states of this side's robot and of its own."""
    return opponent(opponent.observation(_view_of_other(zero_sum_game, own, other)), (), bits)[0]


def answers_by_chance(zero_sum_game: ZeroSumGame, opponent: AbstractPolicy) -> bool:
    """Whether random bits can matter to what the opponent takes."""
    place = RobotState(*[jnp.zeros(())] * 4)
    return acts_by_chance(opponent, _view_of_other(zero_sum_game, place, place))


def _view_of_other(zero_sum_game: ZeroSumGame, own: RobotState, other: RobotState) -> View:
    state = GameState.of_two(*zero_sum_game.pair(own, other), steps=jnp.zeros((), jnp.int32))
    return look(zero_sum_game.game, state, zero_sum_game.role.other)
