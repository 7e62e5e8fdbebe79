"""Env steps per second through the interfaces to other people's tools, on one core.

    taskset --cpu-list 0 python benchmarks/interfaces.py

prints, for each interface, the median and the best of several rounds; one env step moves both robots.
"""

import statistics
import time
from collections.abc import Callable

import numpy as np

import apollonius
from apollonius.adapters.gymnasium import OneSide

ROUNDS, STEPS = 15, 2000


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


def main() -> None:
    for interface in (pettingzoo, gymnasium):
        play, rates = interface(), []
        for _ in range(ROUNDS + 1):
            began = time.perf_counter()
            steps = play()
            rates.append(steps / (time.perf_counter() - began))
        rates = rates[1:]  # the first round compiles
        print(f"{interface.__name__:<12} {statistics.median(rates):>12,.0f} env steps/s, best {max(rates):>12,.0f}")


if __name__ == "__main__":
    main()
