"""The players of the two-robot game that act by a solved table: they look one hold ahead, anew in every step."""

from abc import abstractmethod

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, Shaped

from apollonius.agents.policy import AbstractPolicy, AbstractValued
from apollonius.game.observation import both_states
from apollonius.game.types import NUM_ACTIONS, Action, GameState, RobotState, Role, Scalar
from apollonius.solve.contest import Contest
from apollonius.solve.joint import interpolate
from apollonius.solve.motion import last

Pair = tuple[RobotState, RobotState]
"""The state of a player's own robot, and of the other one."""


class AbstractLookahead(AbstractValued):
    """A player that holds each of its actions by the rules and asks a table what comes after.

    Attributes:
        contest: the game, from its side.
        table: what its side is sure of.
    """

    contest: Contest
    table: Shaped[Array, "tiles moving lanes"]

    @property
    def observation(self) -> str:
        """The profile that tells both robots' states with the least arithmetic."""
        return "paper"

    def values(self, observation: Float[Array, " size"]) -> Float[Array, "9"]:
        """What the nine actions are worth."""
        game = self.contest.game
        bodies = (game.pursuer, game.evader) if self.contest.role == Role.PURSUER else (game.evader, game.pursuer)
        return self.worths(*both_states(self.observation, game.arena, *bodies, observation))

    def best_worth(self, states: GameState) -> Float[Array, " games"]:
        """What its side is sure of in several states of the game, leaves `[games]`."""
        return _best_worths(self, states)

    @abstractmethod
    def worths(self, own: RobotState, other: RobotState) -> Float[Array, "9"]:
        """The same from both robots' states."""


class SaddlePolicy(AbstractLookahead):
    """The player of either side that makes most of what it can be sure of (`guarantee`).

    `table` is that of `solve_duel`: what its side is sure of once it has moved.
    """

    def worths(self, own: RobotState, other: RobotState) -> Float[Array, "9"]:
        """What each action is worth against the answer that is worst for it.

        An answer counts by the rules where it ends the game within the hold, and by the table otherwise.
        """
        mine, theirs = (
            jax.vmap(lambda action, robot=robot, motion=motion: motion.hold(robot, action))(jnp.arange(NUM_ACTIONS))
            for motion, robot in zip(self.contest.motions, (own, other), strict=True)
        )
        over, value = jax.vmap(lambda own: jax.vmap(lambda other: self.contest.event(own, other))(theirs))(mine)
        grid, other_grid = self.contest.grids
        later = interpolate(self.table, (other_grid, other), (grid, jax.vmap(last)(mine)))
        worths = jnp.where(over, value, self.contest.motions[0].discount * later[:, None])
        return jnp.min(worths, axis=1)


class ResponsePolicy(AbstractLookahead):
    """The player that makes most of knowing what the other one does.

    Attributes:
        opponent: the other player; it acts without chance, or is met as if it drew the word 0.
    """

    opponent: AbstractPolicy

    def worths(self, own: RobotState, other: RobotState) -> Float[Array, "9"]:
        """What each action is worth while the opponent goes on as it does, and by the table after the hold."""
        contest, (motion, other_motion), (grid, other_grid) = self.contest, self.contest.motions, self.contest.grids
        robots = jax.tree.map(jnp.asarray, (own, other))

        def worth(action: Int[Array, ""]) -> Scalar:
            def one_step(before: Pair, _: None) -> tuple[Pair, Pair]:
                answer = answer_of(contest, self.opponent, *before)
                after = (motion.step(before[0], action), other_motion.step(before[1], answer))
                return after, after

            end, after = jax.lax.scan(one_step, robots, None, motion.steps)
            courses = jax.tree.map(lambda first, rest: jnp.concatenate([first[None], rest]), robots, after)
            over, value = contest.event(*courses)
            there = jax.tree.map(lambda leaf: leaf[None], end[0])
            later = interpolate(self.table, (other_grid, end[1]), (grid, there))[0]
            return jnp.where(over, value, motion.discount * later)

        return jax.vmap(worth)(jnp.arange(NUM_ACTIONS))


@eqx.filter_jit
def _best_worths(player: AbstractLookahead, states: GameState) -> Float[Array, " games"]:
    def best(state: GameState) -> Scalar:
        return jnp.max(player.worths(*player.contest.pair(state.pursuer, state.evader)))

    return jax.vmap(best)(states)


def answer_of(contest: Contest, opponent: AbstractPolicy, own: RobotState, other: RobotState) -> Action:
    """The action that the opponent takes, from the states of this side's robot and of its own."""
    state = GameState(*contest.pair(own, other), steps=jnp.zeros((), jnp.int32))
    seen = contest.game.observe(state, Role(1 - contest.role), opponent.observation)
    return opponent(seen, jnp.zeros((), jnp.uint32))
