"""Gymnasium's vector interface: thousands of games at once in one compiled call, one side from
outside.
"""

from dataclasses import replace
from typing import Any

import gymnasium
import jax
import numpy as np
from gymnasium import Space
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from apollonius.arenas.file import as_game
from apollonius.envs.batch import SPARE, CompiledFunction, GameBatch, RunningGames, require_unforked
from apollonius.envs.options import (
    ObservationOption,
    PlayerOption,
    RewardOption,
    action_space,
    as_actions,
    as_role,
    make_contest,
    observation_space,
    random_bits,
    require_no_options,
    require_option,
)
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.io.errors import require
from apollonius.io.limits import PARALLEL_GAMES, CountLimit

_MODES = {mode.value: mode for mode in (AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP)}
"""By the names that Gymnasium's `make_vec` takes."""
_SYNC = "; vectorization_mode='sync' has it, and is much slower"


class ManyGames(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Many games seen from one side, all stepped together; the other side is a player of the
    package.

    What becomes of a game that has ended is Gymnasium's autoreset mode:

    - `SAME_STEP`: it begins again within the same step, and the observation returned is the new
        game's first. In such
      a step `infos` has `final_obs`, what the step led to in every game, `[games, size]`;
      `_final_obs`, which games ended; and `final_info` with `outcome`, how every game then stood.
    - `NEXT_STEP`: it begins again in the next step, which ignores its action, rewards it with 0,
        and ends nothing.
      `infos["outcome"]` says after every step how each game stands.

    Outcomes are numbers of `apollonius.Outcome`. The games pickle, under way as well as before the
    first reset.

    In games of teams `infos` also has, after every step and before any game begins again,
    `rewards`, each robot's own, and `status`, how each stands, a number of
    `apollonius.game.types.RobotStatus`; both `[games, robots]`. A side of one robot has no axis of
    robots anywhere else; of several, observations are `[games, robots, size]`, actions `[games,
    robots]` or `[games, robots, 2]`, and a game's reward is the mean of its robots'. Those of a
    robot that is out of play are ignored, and it is rewarded with 0.

    Arguments and errors are those of `apollonius.envs.gymnasium.OneSide`, but there is no render
    mode; the mode can be given by its name, `SameStep` or `NextStep`. After `max_episode_steps`, if
    given, a game is truncated.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "autoreset_mode": AutoresetMode.SAME_STEP,
        "render_modes": [],
    }

    def __init__(
        self,
        role: Role | str,
        num_envs: int = 1,
        opponent: PlayerOption = "random",
        game: Game | str = "paper",
        observation: ObservationOption = "encoded",
        actions: str = "discrete",
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        reward: RewardOption = None,
        **unknown: Any,
    ) -> None:
        require_unforked()
        require_option(ManyGames, unknown)
        role = as_role(role)
        PARALLEL_GAMES.require("num_envs", num_envs)
        mode = AutoresetMode(autoreset_mode) if autoreset_mode in _MODES else autoreset_mode
        modes = f"one of {', '.join(_MODES)}{_SYNC}"
        require(mode in _MODES.values(), "autoreset_mode", autoreset_mode, modes)
        bound = f"None: there are no pictures of many games{_SYNC}"
        require(render_mode is None, "render_mode", render_mode, bound)
        contest = make_contest(as_game(game), observation, actions, reward, {role.other: opponent})
        game = _shortened(contest.game, max_episode_steps)
        self.metadata = type(self).metadata | {"autoreset_mode": mode}
        self.num_envs = num_envs
        robots = len(game.bodies[role])
        self._of_teams = game.teams is not None
        self._set_spaces(observation_space(contest.reads), action_space(actions), robots)
        self._kind = actions
        self._acting = (num_envs,) if robots == 1 else (num_envs, robots)
        self._next_step = mode == AutoresetMode.NEXT_STEP
        # The game is a constant of what is compiled.
        batch = GameBatch(game, role, contest.players, num_envs, self._next_step, contest.reward)
        self._draw = CompiledFunction(GameBatch.sample_starts, batch)
        self._step = CompiledFunction(GameBatch.step, batch)
        self._now: RunningGames | None = None
        self._left = 0
        """Sampled starts that have not been used."""

    def _set_spaces(self, observation: Space[Any], action: Space[Any], robots: int) -> None:
        """Set the spaces of one game and of all by those of one robot."""
        if robots > 1:
            observation, action = batch_space(observation, robots), batch_space(action, robots)
        self.single_observation_space = observation
        self.single_action_space = action
        self.observation_space = batch_space(observation, self.num_envs)
        self.action_space = batch_space(action, self.num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start new games from the game's distribution of starts; one seed, not a list, is that of
        all.
        """
        require(
            not isinstance(seed, list),
            "seed",
            seed,
            f"one number or None: it seeds all games{_SYNC}",
        )
        require_no_options(options)
        require_unforked()
        super().reset(seed=seed)  # pyright: ignore[reportArgumentType]
        self._left = 0
        self._provide()
        self._now = now = jax.tree.map(lambda leaf: leaf[: self.num_envs], self._starts)
        self._left -= self.num_envs
        self._ended = np.zeros(self.num_envs, bool)
        return np.array(now.observation), {}

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Step every game by the actions `[games]`, each 0..8, or `[games, 2]`, of a team each
        robot's; raises InvalidInput for impossible ones, and ResetNeeded before the first `reset`.
        """
        if self._now is None:
            raise gymnasium.error.ResetNeeded("games begin with reset()")
        actions = as_actions(actions, self._kind, self._acting)
        self._provide()
        num_used = np.int32(SPARE * self.num_envs - self._left)
        bits = random_bits(self.np_random)
        games, result = self._step(self._now, self._ended, self._starts, num_used, actions, bits)
        self._now = games
        observations = np.array(games.observation)
        reward = np.array(result.reward)
        terminated = np.array(result.terminated)
        truncated = np.array(result.truncated)
        outcome = np.array(result.outcome)
        is_over = terminated | truncated
        if self._next_step:
            self._left -= int(self._ended.sum())
            self._ended = is_over
            infos = self._of_all(outcome=outcome)
        else:
            self._left -= int(is_over.sum())
            final = {
                "final_obs": np.array(result.observation),
                "final_info": {"outcome": outcome, "_outcome": is_over},
            }
            infos = final | {"_final_obs": is_over, "_final_info": is_over} if is_over.any() else {}
        if self._of_teams:
            infos |= self._of_all(rewards=np.array(result.rewards), status=np.array(result.status))
        return observations, reward, terminated, truncated, infos

    def render(self) -> None:
        """Draw nothing."""

    def _of_all(self, **values: np.ndarray) -> dict[str, Any]:
        return values | {f"_{name}": np.ones(self.num_envs, bool) for name in values}

    def _provide(self) -> None:
        """Sample new starts if the last ones might not suffice; each is used once, in their
        order.
        """
        if self._left < self.num_envs:
            self._starts = self._draw(random_bits(self.np_random))
            self._left = SPARE * self.num_envs


def _shortened(game: Game, max_episode_steps: int | None) -> Game:
    """Return a game that is truncated after some steps; raises InvalidInput where the evader would
    win by that.
    """
    if max_episode_steps is None:
        return game
    CountLimit(0).require("max_episode_steps", max_episode_steps)
    bound = "left out, as the evader wins by time: write a game with other max_steps"
    require(not game.reward.time_limit_wins, "max_episode_steps", max_episode_steps, bound)
    return replace(game, max_steps=min(game.max_steps, max_episode_steps))
