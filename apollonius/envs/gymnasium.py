"""Gymnasium's interface: one robot acts from outside, a player of the package plays the other
side.
"""

from typing import Any

import gymnasium
import numpy as np

from apollonius.envs.options import (
    ObservationOption,
    PlayerOption,
    RewardOption,
    as_role,
    random_bits,
    require_no_options,
    require_option,
)
from apollonius.envs.single_game import RENDER_MODES, SingleGame
from apollonius.game.game import Game
from apollonius.game.types import Role
from apollonius.io.errors import require


class OneSide(gymnasium.Env[np.ndarray, int | np.integer | np.ndarray]):
    """A game seen from one side, of one robot; on the other there may be a team.

    Actions are the 9 of Eq. 5, or two numbers in [-1, 1]. The reward is that side's of Eq. 8 or 9.
    `info["outcome"]` is `ongoing`, or the name of a row of Tables II and III. The options are those
    of `apollonius.envs.single_game.SingleGame`.

    Raises InvalidInput for what is unknown, a side of several robots, and in a forked process:
    `gymnasium.vector.AsyncVectorEnv` has those unless it is given `context="spawn"`.
    """

    # as Gymnasium declares it
    metadata: dict[str, Any] = {"render_modes": RENDER_MODES, "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        role: Role | str,
        opponent: PlayerOption = "random",
        game: Game | str = "paper",
        observation: ObservationOption = "encoded",
        render_mode: str | None = None,
        actions: str = "discrete",
        reward: RewardOption = None,
        **unknown: Any,
    ) -> None:
        require_option(OneSide, unknown)
        role = as_role(role)
        self._session = session = SingleGame(
            game, observation, actions, render_mode, reward, {role.other: opponent}
        )
        count = len(session.game.bodies[role])
        sides = f"{role.name.lower()}s"
        bound = f"1, who alone acts from outside: of a team play all {sides} by PettingZoo"
        require(count == 1, sides, count, bound)
        self.metadata = type(self).metadata | {"render_fps": session.frames_per_second}
        self.render_mode = render_mode
        self.observation_space = session.observation_space
        self.action_space = session.action_space
        self._robot = session.places.index((role, 0))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin a new game from the game's distribution of starts."""
        require_no_options(options)
        super().reset(seed=seed)
        self._session.reset(random_bits(self.np_random))
        return self._session.observation(self._robot), {"outcome": self._session.outcome}

    def step(
        self, action: int | np.integer | np.ndarray
    ) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Let all robots hold their actions for one step; raises ResetNeeded where no game is under
        way.
        """
        session = self._session
        if not session.is_running:
            raise gymnasium.error.ResetNeeded("a game begins with reset()")
        actions: list[Any] = [session.idle] * len(session.places)
        actions[self._robot] = action
        session.step(actions, random_bits(self.np_random))
        observation = session.observation(self._robot)
        reward = session.rewards[self._robot]
        return (
            observation,
            reward,
            session.terminated,
            session.truncated,
            {"outcome": session.outcome},
        )

    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return a picture `[height, width, 3]` in mode `rgb_array`; None otherwise."""
        return self._session.picture()


_MANY = "apollonius.envs.vector:ManyGames"
for _name, _role in (("Pursuit", "pursuer"), ("Evasion", "evader")):
    gymnasium.register(
        f"apollonius/{_name}-v0",
        f"{__name__}:OneSide",
        vector_entry_point=_MANY,
        kwargs={"role": _role},
    )
