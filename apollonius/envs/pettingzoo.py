"""PettingZoo's parallel interface: all robots act from outside, at the same time."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils.seeding import np_random
from pettingzoo import ParallelEnv

from apollonius.envs.options import ObservationOption, RewardOption, random_bits, require_option
from apollonius.envs.single_game import RENDER_MODES, SingleGame
from apollonius.game.game import Game
from apollonius.game.types import RobotStatus
from apollonius.io.errors import require


class BothSides(ParallelEnv[str, np.ndarray, Any]):
    """A game between `pursuer_0` and `evader_0`, or all robots of teams up to `pursuer_2` or so,
    who act together.

    Actions are the 9 of Eq. 5, or two numbers in [-1, 1]; rewards are those of Eq. 8 and 9.
    `terminations`: the rules ended the game; `truncations`: the time limit stopped it.
    `infos[agent]["outcome"]` is `ongoing`, or the name of a row of Tables II and III. Arguments and
    errors are those of `apollonius.envs.single_game.SingleGame`.

    In a game of teams a robot that is captured or fails leaves before the others: its termination
    is true in that step, and from then on it is not among `agents` and has neither action nor
    observation. `infos[agent]["status"]` is `active`, `captured`, `hit_obstacle`, `out_of_range` or
    `hit_mate`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (as PettingZoo declares it)
        "name": "apollonius_v0",
        "render_modes": RENDER_MODES,
        "render_fps": 10,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        game: Game | str = "paper",
        observation: ObservationOption = "encoded",
        render_mode: str | None = None,
        actions: str = "discrete",
        reward: RewardOption = None,
        **unknown: Any,
    ) -> None:
        require_option(BothSides, unknown)
        self._session = session = SingleGame(game, observation, actions, render_mode, reward, {})
        self.metadata = type(self).metadata | {"render_fps": session.frames_per_second}
        self.render_mode = render_mode
        self.possible_agents = [f"{role.name.lower()}_{number}" for role, number in session.places]
        self.agents: list[str] = []
        self.observation_spaces = dict.fromkeys(self.possible_agents, session.observation_space)
        self.action_spaces = dict.fromkeys(self.possible_agents, session.action_space)
        self._random, _ = np_random()

    def observation_space(self, agent: str) -> gymnasium.spaces.Space[np.ndarray]:
        """Return the space of observations, which all agents share."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.spaces.Space[Any]:
        """Return the space of actions, which all agents share."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Begin a new game from the game's distribution of starts; games after a seeded one are
        seeded too.

        There are no options; PettingZoo's own test gives some.
        """
        if seed is not None:
            self._random, _ = np_random(seed)
        self._session.reset(random_bits(self._random))
        self.agents = list(self.possible_agents)
        return self._observations(), self._infos()

    def step(
        self, actions: dict[str, int | np.integer | np.ndarray]
    ) -> tuple[
        dict[str, np.ndarray],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Let all agents hold their actions for one step; raises ResetNeeded where no game is under
        way.
        """
        if not self.agents:
            raise gymnasium.error.ResetNeeded("a game begins with reset()")
        strangers = sorted(actions.keys() - set(self.possible_agents))
        bound = f"among {', '.join(self.possible_agents)}"
        require(not strangers, "agents", ", ".join(map(str, strangers)), bound)
        session = self._session
        all_actions = [
            actions.get(agent) if agent in self.agents else session.idle
            for agent in self.possible_agents
        ]
        session.step(all_actions, np.uint32(0))
        statuses = self._each(session.statuses)
        is_active = {agent: status == RobotStatus.ACTIVE for agent, status in statuses.items()}
        results = (
            self._each(session.rewards),
            {agent: session.terminated or not is_active[agent] for agent in self.agents},
            {agent: session.truncated and is_active[agent] for agent in self.agents},
            self._infos(),
        )
        observations = self._observations()
        is_over = session.terminated or session.truncated
        self.agents = [agent for agent in self.agents if is_active[agent] and not is_over]
        return observations, *results

    def render(self) -> np.ndarray | None:
        """Return a picture `[height, width, 3]` in mode `rgb_array`; None otherwise."""
        return self._session.picture()

    def _each(self, values: list[Any]) -> dict[str, Any]:
        """Return the values of the agents in play, by name, from those of all robots."""
        by_agent = dict(zip(self.possible_agents, values, strict=True))
        return {agent: by_agent[agent] for agent in self.possible_agents if agent in self.agents}

    def _observations(self) -> dict[str, np.ndarray]:
        return self._each(
            [self._session.observation(robot) for robot in range(len(self.possible_agents))]
        )

    def _infos(self) -> dict[str, dict[str, Any]]:
        common_info = {"outcome": self._session.outcome}
        if self._session.game.teams is None:
            return {agent: dict(common_info) for agent in self.agents}
        statuses = self._each(self._session.statuses)
        return {
            agent: common_info | {"status": RobotStatus(status).name.lower()}
            for agent, status in statuses.items()
        }


parallel_env = BothSides
"""The name under which PettingZoo's users look for it."""
