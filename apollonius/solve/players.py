"""The players of the two-robot game that act by a solved table: they look one hold ahead, anew in every step."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.custom_batching import custom_vmap
from jaxtyping import Array, Float, Int, Shaped, UInt32

from apollonius.agents.policy import AbstractActionValuePolicy, AbstractPolicy, acts_by_chance
from apollonius.game.game import outcome_after
from apollonius.game.types import NUM_ACTIONS, Action, GameState, Outcome, RobotState, Role
from apollonius.observe.view import View, look
from apollonius.solve.event import first_events
from apollonius.solve.joint import interpolate
from apollonius.solve.motion import Motion, ends
from apollonius.solve.zero_sum_game import ZeroSumGame

COURSES = 16
"""Courses of an opponent that acts by chance over which a response takes the mean."""
Pair = tuple[RobotState, RobotState]
"""The state of a player's own robot, and of the other one."""


class AbstractLookahead(AbstractActionValuePolicy):
    """A player that holds each of its actions by the rules and asks a table what comes after.

    Attributes:
        zero_sum_game: the game, from its side.
        table: what its side is sure of.
    """

    zero_sum_game: ZeroSumGame
    table: Shaped[Array, "tiles moving lanes"]

    def values(self, seen: View) -> Float[Array, "9"]:
        """What the nine actions are worth."""
        return self.weigh(seen, jnp.zeros((), jnp.uint32))

    def weigh(self, seen: View, bits: UInt32[Array, ""]) -> Float[Array, "9"]:
        """What they are worth against one who acts by chance, as by these bits."""
        return _values_in_one(self, seen.own.state, seen.opponent.state, bits)

    def best_value(self, states: GameState) -> Float[Array, " games"]:
        """What its side is sure of in several states of the game, leaves `[games]`."""
        return _best_values(self, states)

    @abstractmethod
    def action_values(
        self, own: RobotState, other: RobotState, bits: UInt32[Array, " games"]
    ) -> Float[Array, "9 games"]:
        """What the nine actions are worth in several games at once.

        Args:
            own, other: the robots, leaves `[games]`.
            bits: random bits for each game, of which a player makes use that acts by chance.
        """


@custom_vmap
def _values_in_one(
    player: AbstractLookahead, own: RobotState, other: RobotState, bits: UInt32[Array, ""]
) -> Float[Array, "9"]:
    """What the nine actions are worth in one game; for a batch of games all are looked at together."""
    alone = jax.tree.map(lambda leaf: leaf[None], (own, other, bits))
    return player.action_values(*alone)[:, 0]


@_values_in_one.def_vmap
def _values_in_many(
    size: int, batched: Sequence[Any], player: AbstractLookahead, *seen: Any
) -> tuple[Float[Array, "games 9"], bool]:
    """The rule by which a `vmap` over games asks for all of them at once; `batched` says what is one for each game."""
    if any(jax.tree.leaves(batched[0])):
        axes = jax.tree.map(lambda has: 0 if has else None, tuple(batched))
        return jax.vmap(_values_in_one.fun, in_axes=axes, axis_size=size)(player, *seen), True
    everywhere = jax.tree.map(
        lambda leaf, has: leaf if has else jnp.broadcast_to(leaf, (size, *jnp.shape(leaf))), seen, tuple(batched[1:])
    )
    return player.action_values(*everywhere).T, True


class SaddlePolicy(AbstractLookahead):
    """The player of either side that makes most of what it can be sure of (`guarantee`).

    `table` is that of `solve_duel`: what its side is sure of once it has moved.
    """

    def action_values(
        self, own: RobotState, other: RobotState, bits: UInt32[Array, " games"]
    ) -> Float[Array, "9 games"]:
        """What each action is worth against the answer that is worst for it.

        An answer counts by the rules where it ends the game within the hold, and by the table otherwise.
        """
        zero_sum_game, (grid, other_grid) = self.zero_sum_game, self.zero_sum_game.grids
        mine, theirs = (
            _every_hold(motion, robot) for motion, robot in zip(zero_sum_game.motions, (own, other), strict=True)
        )
        outcome, seconds = first_events(zero_sum_game.game, *zero_sum_game.pair(mine, theirs))
        if zero_sum_game.role == Role.EVADER:
            outcome, seconds = jnp.swapaxes(outcome, 0, 1), jnp.swapaxes(seconds, 0, 1)
        later = interpolate(self.table, (other_grid, other), (grid, jax.tree.map(lambda leaf: leaf[-1], mine)))
        going_on = (zero_sum_game.motions[0].discount * later)[:, None]
        action_values = jnp.where(outcome == Outcome.ONGOING, going_on, zero_sum_game.payoff_of(outcome, seconds))
        return jnp.min(action_values, axis=1)


class ResponsePolicy(AbstractLookahead):
    """The player that makes most of knowing what the other one does.

    An opponent that acts by chance is asked again and again, each time with random bits of the responder's own: its
    actions count as often as it takes them. What it then does in the game is drawn anew.

    Attributes:
        opponent: the other player.
    """

    opponent: AbstractPolicy

    def action_values(
        self, own: RobotState, other: RobotState, bits: UInt32[Array, " games"]
    ) -> Float[Array, "9 games"]:
        """What each action is worth while the opponent goes on as it does, and by the table after the hold.

        Of an opponent that acts by chance it is the mean over `COURSES`, the same ones for each action.
        """
        zero_sum_game, (motion, other_motion), (grid, other_grid) = (
            self.zero_sum_game,
            self.zero_sum_game.motions,
            self.zero_sum_game.grids,
        )
        bits = _bits_of_courses(bits, motion.steps, COURSES if answers_by_chance(zero_sum_game, self.opponent) else 1)
        mine = _every_hold(motion, own)

        def moved(own: RobotState, other: RobotState, bits: UInt32[Array, ""]) -> RobotState:
            return other_motion.step(other, answer_of(zero_sum_game, self.opponent, own, other, bits))

        def judged(before: Pair, after: Pair) -> Int[Array, ""]:
            step = jnp.zeros((), jnp.int32)
            return outcome_after(
                zero_sum_game.game,
                GameState.of_two(*zero_sum_game.pair(*before), step),
                GameState.of_two(*zero_sum_game.pair(*after), step),
            )

        # By action, course and game, games last: along them the processor takes several at a time.
        of_courses = jax.vmap(jax.vmap(moved), (None, 0, 0))
        of_actions = jax.vmap(of_courses, (0, 0, None))
        judged_all = jax.vmap(jax.vmap(jax.vmap(judged), ((None, 0), (None, 0))))

        def one_step(so_far: Followed, taken: tuple[Pair, UInt32[Array, "courses games"]]) -> tuple[Followed, None]:
            (before, after), bits = taken
            there = of_actions(before, so_far.other, bits)
            return so_far.then(judged_all((before, so_far.other), (after, there)), there), None

        # Before the first step it is the same question for all nine actions.
        courses, games = bits.shape[1:]
        start = _repeated(other, courses)
        first = _repeated(of_courses(own, start, bits[0]), NUM_ACTIONS)
        begun = _repeated(start, NUM_ACTIONS)
        before, after = (jax.tree.map(lambda leaf, end=end: leaf[end], mine) for end in (0, 1))
        outcomes = judged_all((before, begun), (after, first))
        followed = Followed(first, outcomes, jnp.ones(outcomes.shape, jnp.int32))
        steps = ends(jax.tree.map(lambda leaf: leaf[1:], mine))
        followed, _ = jax.lax.scan(one_step, followed, (steps, bits[1:]))

        flat = NUM_ACTIONS * courses * games
        here = jax.tree.map(lambda leaf: jnp.repeat(leaf[-1][:, None], courses, axis=1).reshape(1, flat), mine)
        there = jax.tree.map(lambda leaf: leaf.reshape(flat), followed.other)
        later = interpolate(self.table, (other_grid, there), (grid, here)).reshape(NUM_ACTIONS, courses, games)
        value = zero_sum_game.payoff_of(followed.outcome, followed.steps.astype(jnp.float32) * zero_sum_game.game.dt)
        ongoing = followed.outcome == Outcome.ONGOING
        return jnp.mean(jnp.where(ongoing, motion.discount * later, value), axis=1)


class Followed(eqx.Module):
    """An opponent that is followed through a hold, by action, course and game.

    Attributes:
        other: where it is.
        outcome, steps: how the game stands, and after how many steps it ended.
    """

    other: RobotState
    outcome: Int[Array, "9 courses games"]
    steps: Int[Array, "9 courses games"]

    def then(self, outcome: Int[Array, "9 courses games"], other: RobotState) -> "Followed":
        """The same one step on; a game that is over stays as it ended."""
        ongoing = self.outcome == Outcome.ONGOING
        return Followed(other, jnp.where(ongoing, outcome, self.outcome), self.steps + ongoing.astype(jnp.int32))


def _every_hold(motion: Motion, robots: RobotState) -> RobotState:
    """The courses of all nine actions in several games, leaves `[games]`: leaves `[steps + 1, 9, games]`."""
    in_games = jax.vmap(motion.hold, (0, None), -1)
    return jax.vmap(in_games, (None, 0), 1)(robots, jnp.arange(NUM_ACTIONS))


def _bits_of_courses(bits: UInt32[Array, " games"], steps: int, courses: int) -> UInt32[Array, "steps courses games"]:
    """Random bits for each course of each game, from one for each game; all 0 for the one course without chance."""
    if courses == 1:
        return jnp.zeros((steps, 1, *bits.shape), jnp.uint32)
    return jax.vmap(lambda bits: jax.random.bits(jax.random.key(bits), (steps, courses), jnp.uint32), out_axes=-1)(bits)


def _repeated(robots: RobotState, times: int) -> RobotState:
    return jax.tree.map(lambda leaf: jnp.repeat(leaf[None], times, axis=0), robots)


@eqx.filter_jit
def _best_values(player: AbstractLookahead, states: GameState) -> Float[Array, " games"]:
    own, other = player.zero_sum_game.pair(states.pursuer, states.evader)
    return jnp.max(player.action_values(own, other, jnp.zeros(own.x.shape, jnp.uint32)), axis=0)


def answer_of(
    zero_sum_game: ZeroSumGame, opponent: AbstractPolicy, own: RobotState, other: RobotState, bits: UInt32[Array, ""]
) -> Action:
    """The action that the opponent takes, from the states of this side's robot and of its own."""
    return opponent(opponent.observation(_view_of_other(zero_sum_game, own, other)), bits)


def answers_by_chance(zero_sum_game: ZeroSumGame, opponent: AbstractPolicy) -> bool:
    """Whether random bits can matter to what the opponent takes."""
    place = RobotState(*[jnp.zeros(())] * 4)
    return acts_by_chance(opponent, _view_of_other(zero_sum_game, place, place))


def _view_of_other(zero_sum_game: ZeroSumGame, own: RobotState, other: RobotState) -> View:
    state = GameState.of_two(*zero_sum_game.pair(own, other), steps=jnp.zeros((), jnp.int32))
    return look(zero_sum_game.game, state, zero_sum_game.role.other)
