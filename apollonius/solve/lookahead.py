"""Search at play: one hold ahead by the rules, against every answer, with a network's value behind it."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, UInt32

from apollonius.agents.greedy import Greedy
from apollonius.agents.policy import AbstractActionValuePolicy
from apollonius.game.game import Game
from apollonius.game.types import NUM_ACTIONS, GameState, Outcome, Real, RobotState, Role
from apollonius.observe.view import View, Views
from apollonius.solve.event import first_events
from apollonius.solve.motion import last
from apollonius.solve.players import every_hold
from apollonius.solve.reference import joint_grid
from apollonius.solve.zero_sum_game import ZeroSumGame, make_zero_sum_game

SECONDS = 1.0
"""How long actions are held in what is looked at [s], as in the tables that networks are taught by."""
SLACK = 0.1
"""Actions whose worst is within this of the best are equally good by the search; then the network's own values decide.
It is about what a network errs by from one state to another. Between the actions of a state it errs by much less.
"""
_LEAST = 1e-3
"""What the network's own values count for beside the search."""


class Lookahead(AbstractActionValuePolicy):
    """The player that holds each action against each of the nine answers, and avoids those whose worst is bad.

    A pair of actions counts by the rules where it ends the game, and otherwise by the value of the best action that the
    network sees behind it. The answer is chosen by one who knows the action, so the search is on the safe side.

    Attributes:
        zero_sum_game: the game, from its side; of its grids nothing is used.
        player: the player by the network.
        scale: what its values are divided by, so that a game that is lost is worth about -1.
        slack: by how much an action's worst may fall short of the best without anything being made of it.
    """

    zero_sum_game: ZeroSumGame
    player: Greedy
    scale: Real
    slack: Real = SLACK

    def values(self, seen: View) -> Float[Array, "9"]:
        """What the nine actions are worth."""
        own, other = (jax.tree.map(lambda leaf: jnp.asarray(leaf)[None], robot.state) for robot in seen.robots)
        return self._action_values(own, other)[0]

    def weigh_together(self, seen: Views, bits: UInt32[Array, " games"]) -> Float[Array, "games 9"]:
        """What they are worth in each of many games."""
        own, other = (seen.states.robots[side][0] for side in (seen.role, seen.role.other))
        return self._action_values(own, other)

    def _action_values(self, own: RobotState, other: RobotState) -> Float[Array, "games 9"]:
        worst = jnp.min(self._after_a_hold(own, other), axis=1).T
        enough = jnp.max(worst, axis=1, keepdims=True) - self.slack
        return jnp.minimum(worst, enough) + _LEAST * self._by_network(own, other)

    def _after_a_hold(self, own: RobotState, other: RobotState) -> Float[Array, "9 9 games"]:
        """What is behind each action and each answer to it."""
        game = self.zero_sum_game
        mine, theirs = (every_hold(motion, robot) for motion, robot in zip(game.motions, (own, other), strict=True))
        outcome, seconds = first_events(game.game, *game.pair(mine, theirs))
        if game.role == Role.EVADER:
            outcome, seconds = jnp.swapaxes(outcome, 0, 1), jnp.swapaxes(seconds, 0, 1)

        pairs = (NUM_ACTIONS, *last(mine).x.shape)
        ends = (
            jax.tree.map(lambda leaf: jnp.broadcast_to(leaf[:, None], pairs).reshape(-1), last(mine)),
            jax.tree.map(lambda leaf: jnp.broadcast_to(leaf[None], pairs).reshape(-1), last(theirs)),
        )
        # Whatever the network says, no game that goes on is worth more than one that is won, or less than a lost one.
        later = jnp.clip(jnp.max(self._by_network(*ends), axis=1), -1.0, 1.0).reshape(pairs)
        return jnp.where(outcome == Outcome.ONGOING, game.motions[0].discount * later, game.payoff_of(outcome, seconds))

    def _by_network(self, own: RobotState, other: RobotState) -> Float[Array, "games 9"]:
        """The network's own values."""
        game = self.zero_sum_game
        nothing = jnp.zeros(own.x.shape, jnp.int32)
        states = jax.vmap(GameState.of_two)(*game.pair(own, other), nothing)
        seen = self.player.observation.together(Views(game.game, states, game.role))
        return self.player.weigh_together(seen, nothing.astype(jnp.uint32)) / self.scale


def lookahead(player: Greedy, game: Game, role: Role, scale: Real) -> Lookahead:
    """A player that searches one hold ahead with a network's value behind it; arguments as of `Lookahead`.

    Raises:
        InvalidInput: for a game in one of several arenas.
    """
    hold = max(1, round(SECONDS / float(game.dt)))
    grids = joint_grid(game, Role.PURSUER)[0], joint_grid(game, Role.EVADER)[0]
    return Lookahead(make_zero_sum_game(game, grids, hold, role, "win"), player, scale)
