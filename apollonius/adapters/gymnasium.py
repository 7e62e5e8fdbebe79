"""Gymnasium's interface: one side acts from outside, a player of the package acts on the other."""

from typing import Any

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.catalogue import find_agent
from apollonius.errors import require
from apollonius.game.game import Game
from apollonius.game.observation import OBSERVATION_SIZES
from apollonius.game.presets import make_game
from apollonius.game.types import NUM_ACTIONS, GameState, Outcome, Role


class OneSide(gymnasium.Env[np.ndarray, int | np.integer]):
    """A game seen from one side.

    Actions are the 9 of Eq. 5. The reward is that side's of Eq. 8 or 9. `info["outcome"]` says how the game stands:
    `ongoing`, or the name of a row of Tables II and III.

    Args:
        role: the side that acts from outside.
        opponent: player of the other side, as `find_agent` knows it.
        game: the game, or the name of one.
        observation: profile of what is seen (`apollonius.game.observation`); each number is within 2 of 0, unless a
            robot leaves the walls by more than half the arena in one step.

    Raises:
        InvalidInput: for an unknown opponent, game or observation.
    """

    def __init__(
        self, role: Role, opponent: str = "random", game: Game | str = "paper", observation: str = "encoded"
    ) -> None:
        require(observation in OBSERVATION_SIZES, "observation", observation, f"one of {', '.join(OBSERVATION_SIZES)}")
        game = make_game(game) if isinstance(game, str) else game
        size = OBSERVATION_SIZES[observation]
        self.observation_space = gymnasium.spaces.Box(-2.0, 2.0, (size,), np.float32)
        self.action_space = gymnasium.spaces.Discrete(NUM_ACTIONS)
        other = Role.EVADER if role == Role.PURSUER else Role.PURSUER
        player = find_agent(opponent, other, game).policy

        # The game is a constant of the compiled step: passing its many numbers costs more than the step itself.
        @jax.jit
        def begin(seed: UInt32[Array, ""]) -> tuple[GameState, Float[Array, " size"]]:
            state = game.reset(jax.random.key(seed))
            return state, game.observe(state, role, observation)

        @jax.jit
        def step(
            state: GameState, action: Int[Array, ""], word: UInt32[Array, ""]
        ) -> tuple[GameState, Float[Array, " told"]]:
            answer = player(game.observe(state, other, player.observation), word)
            actions = (action, answer) if role == Role.PURSUER else (answer, action)
            after = game.step(state, *actions)
            reward = after.pursuer_reward if role == Role.PURSUER else after.evader_reward
            flags = [flag.astype(jnp.float32) for flag in (after.terminated, after.truncated, after.outcome)]
            told = jnp.stack([reward, *flags])
            return after.state, jnp.concatenate([game.observe(after.state, role, observation), told])

        self._begin, self._step = begin, step
        self._state: GameState | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        """A new game from the game's distribution of starts."""
        super().reset(seed=seed)
        self._state, observation = self._begin(self._word())
        return np.array(observation), {"outcome": "ongoing"}

    def step(self, action: int | np.integer) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Both sides hold their actions for one step.

        Raises:
            gymnasium.error.ResetNeeded: before the first `reset`.
        """
        if self._state is None:
            raise gymnasium.error.ResetNeeded("a game begins with reset()")
        self._state, packed = self._step(self._state, np.int32(action), self._word())
        *_, reward, terminated, truncated, outcome = told = np.asarray(packed)
        info = {"outcome": Outcome(int(outcome)).name.lower()}
        return told[:-4].copy(), float(reward), bool(terminated), bool(truncated), info

    def _word(self) -> np.uint32:
        return np.uint32(self.np_random.integers(2**32, dtype=np.uint64))


gymnasium.register("apollonius/Pursuit-v0", f"{__name__}:OneSide", kwargs={"role": Role.PURSUER})
gymnasium.register("apollonius/Evasion-v0", f"{__name__}:OneSide", kwargs={"role": Role.EVADER})
