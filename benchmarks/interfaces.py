"""Env steps per second through the interfaces to other people's tools, on one core.

    taskset --cpu-list 0 python benchmarks/interfaces.py

prints, for each interface, the median and the best of several rounds, and the median per second of CPU time, which is
what a core that does nothing else would do; one env step moves both robots.
"""

import statistics
import time
from collections.abc import Callable

import numpy as np

import apollonius
from apollonius.adapters.gymnasium import OneSide
from apollonius.adapters.vector import ManyGames

ROUNDS, STEPS = 15, 2000
GAMES, VECTOR_STEPS = 4096, 200


def pettingzoo() -> Callable[[], int]:
    """Random play of both sides through the parallel environment, and a `reset` after each game."""
    env = apollonius.parallel_env()
    env.reset(seed=0)
    actions = np.random.default_rng(0).integers(9, size=(STEPS, 2)).tolist()

    def play() -> int:
        for pursuer, evader in actions:
            env.step({"pursuer_0": pursuer, "evader_0": evader})
            if not env.agents:
                env.reset()
        return STEPS

    return play


def gymnasium() -> Callable[[], int]:
    """Random play of the pursuer against a random evader, and a `reset` after each game."""
    env = OneSide(apollonius.Role.PURSUER)
    env.reset(seed=0)
    actions = np.random.default_rng(0).integers(9, size=STEPS).tolist()

    def play() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()
        return STEPS

    return play


def vector(observation: str) -> Callable[[], int]:
    """4,096 pursuers that act at random against random evaders, in Gymnasium's vector interface."""
    env = ManyGames(apollonius.Role.PURSUER, GAMES, observation=observation)
    env.reset(seed=0)
    actions = np.random.default_rng(0).integers(9, size=(VECTOR_STEPS, GAMES)).astype(np.int32)

    def play() -> int:
        for row in actions:
            env.step(row)
        return VECTOR_STEPS * GAMES

    return play


def vector_paper() -> Callable[[], int]:
    """With the observation of the paper, 8 numbers."""
    return vector("paper")


def vector_encoded() -> Callable[[], int]:
    """With the encoded observation, 17 numbers."""
    return vector("encoded")


def main() -> None:
    print(f"{'':<14} {'median':>12} {'best':>12} {'per CPU second':>16}   [env steps per second]")
    for interface in (pettingzoo, gymnasium, vector_paper, vector_encoded):
        play = interface()
        play()  # compiles
        rates, used = [], []
        for _ in range(ROUNDS):
            wall, cpu = time.perf_counter(), time.process_time()
            steps = play()
            rates.append(steps / (time.perf_counter() - wall))
            used.append(steps / (time.process_time() - cpu))
        print(
            f"{interface.__name__:<14} {statistics.median(rates):>12,.0f} {max(rates):>12,.0f} "
            f"{statistics.median(used):>16,.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
