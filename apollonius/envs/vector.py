"""Gymnasium's vector interface: thousands of games at once in one compiled call, one side from outside.

In games of teams all robots of that side act from outside, and arrays have an axis of robots.
"""

from typing import Any

import gymnasium
import jax
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from jaxtyping import Bool

from apollonius.arenas.charting import charted
from apollonius.arenas.file import as_game
from apollonius.catalogue import find_player
from apollonius.envs.compiled import Compiled, require_unforked
from apollonius.envs.one_side import SPARE, OneSideSetup, Standing, renew, sample_starts, step_games
from apollonius.envs.spaces import action_space, as_actions, observation_space, team_action_space
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.io.errors import require
from apollonius.io.limits import PARALLEL_GAMES
from apollonius.observe.registry import find_observation

_MODES = {mode.value: mode for mode in AutoresetMode}
"""By the names that Gymnasium's `make_vec` takes."""


class ManyGames(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many games seen from one side, all stepped together; the other side is a player of the package.

    What becomes of a game that has ended is Gymnasium's autoreset mode:

    - `SAME_STEP`: it begins again within the same step, and the observation returned is the new game's first. In such
      a step `infos` has `final_obs`, what the step led to in every game, `[games, size]`; `_final_obs`, which games
      ended; and `final_info` with `outcome`, how every game then stood.
    - `NEXT_STEP`: it begins again in the next step, which ignores its action, rewards it with 0, and ends nothing.
    - `DISABLED`: it begins again with `reset(options={"reset_mask": ended})`, before the next step.

    In the last two `infos["outcome"]` says after every step how each game stands. Outcomes are numbers of
    `apollonius.Outcome`. The games pickle, under way as well as before the first reset.

    In games of teams `infos` also has, after every step and before any game begins again, `rewards`, each robot's own,
    and `status`, how each stands, a number of `apollonius.game.types.RobotStatus`; both `[games, robots]`. A side of
    one robot has no axis of robots anywhere else; of several, observations are `[games, robots, size]`, actions
    `[games, robots]` or `[games, robots, 2]`, and a game's reward is the mean of its robots'. Those of a robot that is
    out of play are ignored, and it is rewarded with 0.

    Args:
        role: the side that acts from outside.
        num_envs: number of games.
        opponent, game, observation, actions: as those of `apollonius.envs.gymnasium.OneSide`.
        autoreset_mode: one of Gymnasium's, or its name: `SameStep`, `NextStep` or `Disabled`.

    Raises:
        InvalidInput: for an unknown opponent, game, observation, kind of actions or mode, for less than one game or
            more than memory has room for, and in a forked process.
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
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
    ) -> None:
        require_unforked()
        PARALLEL_GAMES.require("num_envs", num_envs)
        mode = autoreset_mode if isinstance(autoreset_mode, AutoresetMode) else _MODES.get(autoreset_mode)
        require(mode is not None, "autoreset_mode", autoreset_mode, f"one of {', '.join(_MODES)}")
        assert mode is not None
        game = as_game(game)
        self.metadata = type(self).metadata | {"autoreset_mode": mode}
        self.num_envs = num_envs
        robots = len(game.bodies[role])
        self.single_observation_space = observation_space(observation, robots)
        self._actions = action_space(actions)
        self.single_action_space = self._actions if robots == 1 else team_action_space(actions, robots)
        self._acting = (num_envs,) if robots == 1 else (num_envs, robots)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        reads, player = find_observation(observation), find_player(opponent, role.other, game).policy
        game = charted(game) if reads.charted or player.charted else game
        self._mode = mode
        # The game is a constant of what is compiled.
        setup = OneSideSetup(game, role, reads, player, num_envs, mode)
        self._draw, self._step, self._renew = (
            Compiled(sample_starts, setup),
            Compiled(step_games, setup),
            Compiled(renew),
        )
        self._now: Standing | None = None
        self._left = 0
        """Starts of the pile that have not been used."""
        self._ended = np.zeros(num_envs, bool)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start new games from the game's distribution of starts.

        Args:
            seed: of these games and of all that are drawn after them.
            options: `reset_mask`, `[games]`, bool: the games that are restarted.

        Raises:
            gymnasium.error.ResetNeeded: for a mask before the first `reset`.
            InvalidInput: for a list of seeds, as one seeds them all, and for an impossible mask.
        """
        require(not isinstance(seed, list), "seed", seed, "one number or None: it seeds all games")
        require_unforked()
        resets = self._mask(options)
        super().reset(seed=seed)  # pyright: ignore[reportArgumentType]
        if seed is not None or resets.all():
            self._left = 0
        self._provide()
        now = jax.tree.map(lambda leaf: leaf[: self.num_envs], self._starts) if self._now is None else self._now
        self._now = now = self._renew(now, self._starts, self._used, resets)
        self._left -= int(resets.sum())
        self._ended = self._ended & ~resets
        return np.array(now.seen), {}

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:  # fmt: skip
        """Step every game.

        Args:
            actions: of the side from outside, `[games]`, each 0..8, or `[games, 2]`; of a team each robot's.

        Raises:
            gymnasium.error.ResetNeeded: before the first `reset`, and for a game that has ended where nothing begins
                it again.
            InvalidInput: for actions of another shape, and for an impossible one.
        """
        if self._now is None:
            raise gymnasium.error.ResetNeeded("games begin with reset()")
        if self._mode == AutoresetMode.DISABLED and self._ended.any():
            ended = int(self._ended.sum())
            raise gymnasium.error.ResetNeeded(f"{ended} games have ended; reset(options={{'reset_mask': ended}})")
        actions = as_actions(actions, self._actions, self._acting)
        self._provide()
        now, result = self._step(self._now, self._ended, self._starts, self._used, actions, self._bits())
        self._now, seen, reward = now, np.array(now.seen), np.array(result.reward)
        terminated, truncated, outcome = (
            np.array(result.terminated),
            np.array(result.truncated),
            np.array(result.outcome),
        )
        over = terminated | truncated
        if self._mode == AutoresetMode.SAME_STEP:
            self._left -= int(over.sum())
            infos = _final(np.array(result.led_to), outcome, over) if over.any() else {}
        else:
            if self._mode == AutoresetMode.NEXT_STEP:
                self._left -= int(self._ended.sum())
            self._ended = over
            infos = self._of_all(outcome=outcome)
        if result.rewards is not None:
            infos |= self._of_all(rewards=np.array(result.rewards), status=np.array(result.status))
        return seen, reward, terminated, truncated, infos

    def _of_all(self, **values: np.ndarray) -> dict[str, Any]:
        return values | {f"_{name}": np.ones(self.num_envs, bool) for name in values}

    @property
    def _used(self) -> np.int32:
        return np.int32(SPARE * self.num_envs - self._left)

    def _provide(self) -> None:
        """A new pile of starts where the last might not do; each is used once, from the first on."""
        if self._left < self.num_envs:
            self._starts, self._left = self._draw(self._bits()), SPARE * self.num_envs

    def _mask(self, options: dict[str, Any] | None) -> Bool[np.ndarray, " games"]:
        if options is None or "reset_mask" not in options:
            return np.ones(self.num_envs, bool)
        mask = np.asarray(options["reset_mask"])
        require(mask.dtype == bool, "number type of reset_mask", mask.dtype, "bool")
        require(mask.shape == (self.num_envs,), "shape of reset_mask", mask.shape, f"({self.num_envs},)")
        require(bool(mask.any()), "games in reset_mask", 0, "at least 1")
        if self._now is None and not mask.all():
            raise gymnasium.error.ResetNeeded("games begin with reset(), of all of them")
        return mask

    def _bits(self) -> np.uint32:
        return np.uint32(self.np_random.integers(2**32, dtype=np.uint64))


def _final(led_to: np.ndarray, outcome: np.ndarray, over: np.ndarray) -> dict[str, Any]:
    """Return the `info` of games that ended and were restarted."""
    return {
        "final_obs": led_to,
        "_final_obs": over,
        "final_info": {"outcome": outcome, "_outcome": over},
        "_final_info": over,
    }
