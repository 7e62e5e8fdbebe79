"""Search at play: one hold ahead by the rules, against every answer, with a network's value behind it."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, UInt32

from apollonius.agents.greedy import Greedy
from apollonius.game.game import Game
from apollonius.game.types import GameState, Real, RobotState, Role
from apollonius.observe.view import Views
from apollonius.solve.players import AbstractLookahead, hold_all
from apollonius.solve.reference import joint_grid
from apollonius.solve.zero_sum_game import make_zero_sum_game

SECONDS = 1.0
"""How long actions are held in what is looked at [s], as in the tables that networks are taught by."""
SLACK = 0.1
"""Actions whose worst is within this of the best are equally good by the search; then the network's own values decide.
It is about what a network errs by from one state to another. Between the actions of a state it errs by much less.
"""
_LEAST = 1e-3
"""What the network's own values count for beside the search."""


class Lookahead(AbstractLookahead):
    """The player that holds each action against each of the nine answers, and avoids those whose worst is bad.

    A pair of actions counts by the rules where it ends the game, and otherwise by the value of the best action that the
    network sees behind it. The answer is chosen by one who knows the action, so the search is on the safe side.

    Attributes:
        player: the player by the network.
        scale: what its values are divided by, so that a game that is lost is worth about -1.
        slack: by how much an action's worst may fall short of the best without anything being made of it.
    """

    player: Greedy
    scale: Real
    slack: Real = SLACK

    def action_values(
        self, own: RobotState, other: RobotState, bits: UInt32[Array, " games"]
    ) -> Float[Array, "9 games"]:
        """What each action is worth against the answer that is worst for it; beyond the slack, by the network."""
        held = hold_all(self.zero_sum_game, own, other)
        pairs = held.worth.shape
        ends = (
            jax.tree.map(lambda leaf: jnp.broadcast_to(leaf[:, None], pairs).reshape(-1), held.own),
            jax.tree.map(lambda leaf: jnp.broadcast_to(leaf[None], pairs).reshape(-1), held.other),
        )
        # Whatever the network says, no game that goes on is worth more than one that is won, or less than a lost one.
        later = jnp.clip(jnp.max(self._by_network(*ends), axis=1), -1.0, 1.0).reshape(pairs)
        worst = jnp.min(jnp.where(held.ongoing, self.zero_sum_game.motions[0].discount * later, held.worth), axis=1)
        enough = jnp.max(worst, axis=0, keepdims=True) - self.slack
        return jnp.minimum(worst, enough) + _LEAST * self._by_network(own, other).T

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
