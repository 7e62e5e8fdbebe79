"""PettingZoo's parallel interface: all robots act from outside, at the same time."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils.seeding import np_random
from pettingzoo import ParallelEnv

from apollonius.arenas.file import as_game
from apollonius.envs.compiled import require_unforked
from apollonius.envs.live import RENDER_MODES, LiveGame, View
from apollonius.envs.spaces import action_space, observation_space
from apollonius.game.game import Game


class BothSides(ParallelEnv[str, np.ndarray, Any]):
    """A game between `pursuer_0` and `evader_0`, or all robots of teams up to `pursuer_2` or so, who act together.

    Actions are the 9 of Eq. 5, or two numbers in [-1, 1]; rewards are those of Eq. 8 and 9. `terminations`: the rules
    ended the game; `truncations`: the time limit stopped it. `infos[agent]["outcome"]` is `ongoing`, or the name of a
    row of Tables II and III.

    In a game of teams a robot that is captured or fails leaves before the others: its termination is true in that step,
    and from then on it is not among `agents` and has neither action nor observation. `infos[agent]["status"]` is
    `active`, `captured`, `hit_obstacle`, `out_of_range` or `hit_mate`.

    Args:
        game: the game, the name of one, or its `.toml` or `.json` file.
        observation: name of what is seen (`apollonius.observe.registry`).
        render_mode: `rgb_array` for pictures from `render`, `human` to draw every step in the terminal, or None.
        actions: `discrete`, or `continuous`: shares of the largest acceleration and turn rate in [-1, 1].

    Raises:
        InvalidInput: for an unknown game, observation, render mode or kind of actions.
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
        observation: str = "encoded",
        render_mode: str | None = None,
        actions: str = "discrete",
    ) -> None:
        require_unforked()
        game = as_game(game)
        self.metadata = type(self).metadata | {"render_fps": max(1, round(1 / float(game.dt)))}
        self.render_mode = render_mode
        self._live = LiveGame(game, observation, actions=actions)
        self.possible_agents = [f"{role.name.lower()}_{number}" for role, number in self._live.places]
        self.agents: list[str] = []
        self.observation_spaces = {agent: observation_space(observation) for agent in self.possible_agents}
        self.action_spaces = {agent: action_space(actions) for agent in self.possible_agents}
        self._view = View(self._live, render_mode)
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
        """A new game from the game's distribution of starts; games after a seeded one are seeded too."""
        if seed is not None:
            self._random, _ = np_random(seed)
        self._live.reset(np.uint32(self._random.integers(2**32, dtype=np.uint64)))
        self._view.begin()
        self.agents = list(self.possible_agents)
        return self._observations(), self._infos()

    def step(
        self, actions: dict[str, int | np.integer | np.ndarray]
    ) -> tuple[
        dict[str, np.ndarray], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:  # fmt: skip
        """All agents hold their actions for one step.

        Raises:
            gymnasium.error.ResetNeeded: before the first `reset`, and after the end of a game.
            InvalidInput: for an invalid or missing action.
        """
        if not self.agents:
            raise gymnasium.error.ResetNeeded("a game begins with reset()")
        live, acting = self._live, set(self.agents)
        live.step([actions.get(agent) if agent in acting else live.idle for agent in self.possible_agents])
        self._view.follow()
        over = live.terminated or live.truncated
        stays = dict(zip(self.possible_agents, live.active, strict=True))
        rewards = dict(zip(self.possible_agents, live.rewards, strict=True))
        result = (
            self._observations(),
            {agent: rewards[agent] for agent in self.agents},
            {agent: live.terminated or not stays[agent] for agent in self.agents},
            {agent: live.truncated and stays[agent] for agent in self.agents},
            self._infos(),
        )
        self.agents = [] if over else [agent for agent in self.agents if stays[agent]]
        return result

    def render(self) -> np.ndarray | None:
        """A picture `[height, width, 3]` in mode `rgb_array`; None otherwise."""
        return self._view.render()

    def _observations(self) -> dict[str, np.ndarray]:
        places = enumerate(self.possible_agents)
        return {agent: self._live.observation(place) for place, agent in places if agent in self.agents}

    def _infos(self) -> dict[str, dict[str, Any]]:
        infos: dict[str, dict[str, Any]] = {agent: {"outcome": self._live.outcome} for agent in self.agents}
        for agent, status in zip(self.possible_agents, self._live.statuses, strict=False):
            if agent in infos:
                infos[agent]["status"] = status
        return infos


def parallel_env(
    game: Game | str = "paper",
    observation: str = "encoded",
    render_mode: str | None = None,
    actions: str = "discrete",
) -> BothSides:
    """The game as PettingZoo's parallel environment; arguments and errors are those of `BothSides`."""
    return BothSides(game, observation, render_mode, actions)
