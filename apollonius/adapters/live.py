"""One game under way behind one compiled call: what the interfaces to a single game share."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, UInt32

from apollonius.adapters.compiled import Compiled
from apollonius.adapters.spaces import action_space, as_actions
from apollonius.agents.policy import AbstractPolicy
from apollonius.arenas.charting import charted
from apollonius.game.game import Game
from apollonius.game.types import Action, GameState, Outcome, RobotState, Role, Timestep
from apollonius.observe.registry import find_observation, observe
from apollonius.observe.view import look

_ROBOTS = slice(0, 8)
"""In what a step tells: x, y, v, heading of the pursuer, then of the evader. Both observations follow, then ..."""
_REWARDS = slice(-5, -3)
_TERMINATED, _TRUNCATED, _OUTCOME = -3, -2, -1
_OUTCOMES = [outcome.name.lower() for outcome in Outcome]
_NO_BITS = np.uint32(0)


class LiveGame:
    """One game, one step at a time, either side's action from outside or from a player of the package.

    It pickles, before its first reset as well as under way. All that a step needs and tells is one array each: passing
    a game's many numbers costs several times the step.

    Args:
        game: the rules.
        observation: name of what both sides see (`apollonius.observe.registry`).
        inside: the player of each side that is not played from outside.
        actions: kind of the actions from outside, `discrete` or `continuous`.
    """

    def __init__(
        self,
        game: Game,
        observation: str,
        inside: dict[Role, AbstractPolicy] | None = None,
        actions: str = "discrete",
    ) -> None:
        self._space = action_space(actions)
        self.idle = np.zeros(self._space.shape or ())
        """What stands for the action of a side that is played from inside."""
        reads = find_observation(observation)
        game.require_one_arena("an environment of a single game")
        game.require_two("an environment")
        self.game = game = charted(game) if reads.charted else game
        self._seen = {role: slice(8 + role * reads.size, 8 + (role + 1) * reads.size) for role in Role}
        # The game is a constant of both functions.
        self._begin = Compiled(_begin, game, observation)
        self._step = Compiled(_step, game, observation, inside or {}, self.idle.shape)
        self._told: Array | None = None
        self._read = np.zeros(0, np.float32)
        self._steps = 0

    @property
    def begun(self) -> bool:
        """Whether there is a game."""
        return self._told is not None

    def reset(self, bits: np.uint32) -> None:
        """Begin a new game; random bits decide where."""
        self._take(self._begin(bits), 0)

    def step(self, actions: Sequence[Any], bits: np.uint32 = _NO_BITS) -> None:
        """Both sides hold their actions for one step; that of a side played from inside is not looked at.

        Args:
            actions: of the pursuer and the evader, both of the kind of this game's actions.
            bits: random bits for a player inside.

        Raises:
            InvalidInput: for an action that is none.
        """
        pursuer, evader = (as_actions(action, self._space) for action in actions)
        given = np.empty(1 + 2 * pursuer.size, pursuer.dtype)
        given[0], given[1 : 1 + pursuer.size], given[1 + pursuer.size :] = self._steps, pursuer, evader
        self._take(self._step(self._told, given, bits), self._steps + 1)

    def _take(self, told: Array, steps: int) -> None:
        self._told, self._read, self._steps = told, np.asarray(told), steps

    def observation(self, role: Role) -> Float[np.ndarray, " size"]:
        """What a side sees now."""
        return self._read[self._seen[role]].copy()

    @property
    def rewards(self) -> list[float]:
        """Of the pursuer and the evader, for the last step."""
        return self._read[_REWARDS].tolist()

    @property
    def terminated(self) -> bool:
        """Whether the rules have ended the game."""
        return bool(self._read[_TERMINATED])

    @property
    def truncated(self) -> bool:
        """Whether the time limit has stopped it."""
        return bool(self._read[_TRUNCATED])

    @property
    def outcome(self) -> str:
        """How it stands: `ongoing`, or the name of a row of Tables II and III."""
        return _OUTCOMES[int(self._read[_OUTCOME])]

    @property
    def robots(self) -> list[float]:
        """x [m], y [m], v [m/s], heading [rad] of the pursuer, then of the evader."""
        return self._read[_ROBOTS].tolist()


def _begin(game: Game, observation: str, bits: UInt32[Array, ""]) -> Float[Array, " told"]:
    return _tell(game, observation, game.reset(jax.random.key(bits)), [jnp.zeros(())] * 5)


def _step(
    game: Game, observation: str, players: dict[Role, AbstractPolicy], shape: tuple[int, ...],
    told: Float[Array, " told"], given: Int[Array, "3"] | Float[Array, "5"], bits: UInt32[Array, ""],
) -> Float[Array, " told"]:  # fmt: skip
    actions: list[Action] = list(given[1:].reshape(2, *shape))
    state = GameState.of_two(RobotState(*told[:4]), RobotState(*told[4:8]), given[0].astype(jnp.int32))
    for role, player in players.items():
        actions[role] = player(player.observation(look(game, state, role)), bits)
    after: Timestep = game.step(state, *actions)
    flags = [after.terminated, after.truncated, after.outcome]
    return _tell(game, observation, after.state, [*after.reward, *flags])


def _tell(game: Game, observation: str, state: GameState, rest: list[Array]) -> Float[Array, " told"]:
    robots = jnp.stack(jax.tree.leaves(state.robots))
    seen = [observe(game, state, role, observation) for role in Role]
    return jnp.concatenate([robots, *seen, jnp.stack([number.astype(jnp.float32) for number in rest])])
