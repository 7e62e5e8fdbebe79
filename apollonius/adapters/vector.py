"""Gymnasium's vector interface: thousands of games at once in one compiled call, one side from outside."""

from typing import Any

import equinox as eqx
import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from jaxtyping import Array, Bool, Float, Int, UInt32

from apollonius.adapters.spaces import action_space, as_actions, observation_space
from apollonius.agents.catalogue import find_agent
from apollonius.errors import require
from apollonius.game.file import find_game
from apollonius.game.game import Game
from apollonius.game.types import Actions, GameState, Role

_SPARE = 4
"""Starts are drawn beforehand, for this many times the number of games at once."""
_TOGETHER = 512
"""Starts that are drawn again and again until the last of them fits: of more, more would be drawn in vain."""


class Told(eqx.Module):
    """What a step tells of every game, and how many starts have been used."""

    seen: Float[Array, "games size"]
    reward: Float[Array, " games"]
    terminated: Bool[Array, " games"]
    truncated: Bool[Array, " games"]
    outcome: Int[Array, " games"]
    used: Int[Array, ""]


class ManyGames(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many games seen from one side, all stepped together; the other side is a player of the package.

    A game that ends begins again within the same step (Gymnasium's autoreset mode `SAME_STEP`): the observation
    returned is the new game's first. In such a step `infos` has

    - `final_obs`: what the step led to in every game, `[games, size]`, read-only; `_final_obs`: which games ended;
    - `final_info`: with `outcome`, how every game then stood, as numbers of `apollonius.Outcome`.

    Args:
        role: the side that acts from outside.
        num_envs: number of games.
        opponent, game, observation, actions: as those of `apollonius.adapters.gymnasium.OneSide`.

    Raises:
        InvalidInput: for an unknown opponent, game, observation or kind of actions, or less than one game.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.SAME_STEP, "render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        role: Role,
        num_envs: int = 1,
        opponent: str = "random",
        game: Game | str = "paper",
        observation: str = "encoded",
        actions: str = "discrete",
    ) -> None:
        require(num_envs >= 1, "num_envs", num_envs, "at least 1")
        game = find_game(game) if isinstance(game, str) else game
        self.num_envs = num_envs
        self.single_observation_space = observation_space(observation)
        self.single_action_space = self._actions = action_space(actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        other = Role(1 - role)
        player = find_agent(opponent, other, game).policy
        see = jax.vmap(lambda state: game.observe(state, role, observation))
        see_other = jax.vmap(lambda state: game.observe(state, other, player.observation))

        # The game is a constant of both functions.
        @jax.jit
        def draw(word: UInt32[Array, ""]) -> tuple[GameState, Float[Array, "starts size"]]:
            keys = jax.random.split(jax.random.key(word), _SPARE * num_envs)
            starts = jax.lax.map(game.reset, keys, batch_size=_TOGETHER)
            return starts, see(starts)

        @jax.jit
        def step(
            state: GameState, starts: GameState, used: Int[Array, ""], action: Actions,
            word: UInt32[Array, ""],
        ) -> tuple[GameState, Told]:  # fmt: skip
            words = jax.random.bits(jax.random.key(word), (num_envs,), jnp.uint32)
            answer = jax.vmap(player)(see_other(state), words)
            both = (action, answer) if role == Role.PURSUER else (answer, action)
            after = jax.vmap(game.step)(state, *both)
            reward = after.pursuer_reward if role == Role.PURSUER else after.evader_reward
            over = after.terminated | after.truncated
            count = jnp.cumsum(over.astype(jnp.int32))
            told = Told(see(after.state), reward, after.terminated, after.truncated, after.outcome, used + count[-1])
            place = jnp.where(over, used + count - 1, 0)
            state = jax.tree.map(lambda new, old: jnp.where(over, new[place], old), starts, after.state)
            return state, told

        self._draw, self._step = draw, step
        self._state: GameState | None = None

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """New games, all from the game's distribution of starts.

        Raises:
            InvalidInput: for a list of seeds, as one seeds them all.
        """
        require(not isinstance(seed, list), "seed", seed, "one number or None: it seeds all games")
        super().reset(seed=seed)  # pyright: ignore[reportArgumentType]
        self._draw_starts()
        self._state = jax.tree.map(lambda leaf: leaf[: self.num_envs], self._starts)
        self._used = self.num_envs
        return self._starts_seen[: self.num_envs].copy(), {}

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:  # fmt: skip
        """One step of every game; those that end begin again.

        Args:
            actions: of the side from outside, `[games]`, each 0..8, or `[games, 2]`.

        Raises:
            gymnasium.error.ResetNeeded: before the first `reset`.
            InvalidInput: for actions of another shape, and for one that is none.
        """
        if self._state is None:
            raise gymnasium.error.ResetNeeded("games begin with reset()")
        actions = as_actions(actions, self._actions, (self.num_envs,))
        if self._used + self.num_envs > len(self._starts_seen):
            self._draw_starts()
        self._state, told = self._step(self._state, self._starts, np.int32(self._used), actions, self._word())
        terminated, truncated = np.array(told.terminated), np.array(told.truncated)
        final = np.asarray(told.seen)
        seen, infos, used = final.copy(), {}, int(told.used)
        if used > self._used:
            over = terminated | truncated
            seen[over] = self._starts_seen[self._used : used]
            self._used = used
            infos = {
                "final_obs": final,
                "_final_obs": over,
                "final_info": {"outcome": np.asarray(told.outcome), "_outcome": over},
                "_final_info": over,
            }
        return seen, np.array(told.reward), terminated, truncated, infos

    def _draw_starts(self) -> None:
        """A new pile of starts; each is used once, from the first on."""
        self._starts, seen = self._draw(self._word())
        self._starts_seen, self._used = np.asarray(seen), 0

    def _word(self) -> np.uint32:
        return np.uint32(self.np_random.integers(2**32, dtype=np.uint64))
