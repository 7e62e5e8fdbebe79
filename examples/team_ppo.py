"""A team of pursuers learns by the PPO of Stable-Baselines3 from the PettingZoo interface, and shares one network.

    pip install stable-baselines3
    python examples/team_ppo.py --game team-3v1 --env-steps 2000000

trains to catch evaders that stay where they are, then plays games that the team has not seen and says how many end
in a capture.
"""

import argparse
import copy
from typing import Any

import numpy as np
from pettingzoo import ParallelEnv
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv

import apollonius

UNSEEN = 10_000
"""Seed of the first game that is judged."""
STAY = 4
"""The action of a robot that neither speeds up nor turns."""


class Pursuers(VecEnv):
    """The pursuers of several games, each an environment of its own to the learner, so that all share one network.

    A game's pursuers begin and end together: one that is out before sees zeros, is paid nothing, and acts for nothing
    until its game is over.
    """

    def __init__(self, game: str, games: int, seed: int) -> None:
        first = apollonius.parallel_env(game)
        self.games = [first, *(copy.deepcopy(first) for _ in range(games - 1))]  # copies share what is compiled
        self.team = [agent for agent in first.possible_agents if agent.startswith("pursuer")]
        self.random = np.random.default_rng(seed)
        self.asked = np.zeros(0, int)
        one = self.team[0]
        super().__init__(games * len(self.team), first.observation_space(one), first.action_space(one))

    def reset(self) -> np.ndarray:
        return np.concatenate([self.begin(game) for game in self.games])

    def begin(self, game: ParallelEnv[str, np.ndarray, Any]) -> np.ndarray:
        """A new game, and what its pursuers see."""
        return self.seen(game.reset(seed=int(self.random.integers(2**31)))[0])

    def seen(self, told: dict[str, np.ndarray]) -> np.ndarray:
        """What each pursuer sees: zeros, if it is out."""
        nothing = np.zeros(self.observation_space.shape or (), np.float32)
        return np.stack([told.get(agent, nothing) for agent in self.team])

    def play(self, game: ParallelEnv[str, np.ndarray, Any], asked: np.ndarray) -> tuple[Any, ...]:
        """One step of a game: the pursuers as asked, evaders stay."""
        actions = dict.fromkeys(game.agents, STAY)
        actions |= {agent: action for agent, action in zip(self.team, asked.tolist(), strict=True) if agent in actions}
        return game.step(actions)

    def step_async(self, actions: np.ndarray) -> None:
        self.asked = actions.reshape(len(self.games), len(self.team))

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        seen, rewards, dones, infos = [], [], [], []
        for game, asked in zip(self.games, self.asked, strict=True):
            told, paid, _, truncations, _ = self.play(game, asked)
            over, here = not game.agents, self.seen(told)
            for agent, led_to in zip(self.team, here, strict=True):
                rewards.append(paid.get(agent, 0.0))
                dones.append(over)
                cut = {"terminal_observation": led_to, "TimeLimit.truncated": truncations.get(agent, False)}
                infos.append(cut if over else {})
            seen.append(self.begin(game) if over else here)
        return np.concatenate(seen), np.array(rewards, np.float32), np.array(dones), infos

    def close(self) -> None:
        pass

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self, attr_name, None)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * self.num_envs


def captured(team: Pursuers, learner: PPO, seed: int) -> bool:
    """Whether a game with this seed ends in a capture."""
    game, infos = team.games[0], {}
    seen = team.seen(game.reset(seed=seed)[0])
    while game.agents:
        told, _, _, _, infos = team.play(game, learner.predict(seen, deterministic=True)[0])
        seen = team.seen(told)
    return {info["outcome"] for info in infos.values()} == {"captured"}


def main(arguments: list[str] | None = None) -> float:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--game", default="team-3v1")
    parser.add_argument("--env-steps", type=int, default=2_000_000, help="times pursuers (default: %(default)s)")
    parser.add_argument("--games", type=int, default=200, help="that are judged (default: %(default)s)")
    parser.add_argument("--side-by-side", type=int, default=8, help="games at a time (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)

    team = Pursuers(options.game, options.side_by_side, options.seed)
    learner = PPO(
        "MlpPolicy", team, n_steps=256, batch_size=512, learning_rate=5e-4, ent_coef=0.01, seed=options.seed,
        device="cpu", policy_kwargs={"net_arch": [64, 64]},
    )  # fmt: skip
    learner.learn(options.env_steps)
    rate = float(np.mean([captured(team, learner, UNSEEN + game) for game in range(options.games)]))
    print(f"{rate:.1%} of {options.games} games captured")
    return rate


if __name__ == "__main__":
    main()
