"""A pursuer learns by the DQN of Stable-Baselines3 from the Gymnasium interface: no training code of the package.

    pip install stable-baselines3
    python examples/stable_baselines.py --env-steps 200000

trains against an evader, then plays games that the learner has not seen and says how many end in a capture.
"""

import argparse

import gymnasium
from stable_baselines3 import DQN

import apollonius.envs.gymnasium  # noqa: F401 (registers the names)

UNSEEN = 10_000
"""Seed of the first game that is judged."""


def main(arguments: list[str] | None = None) -> float:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env-steps", type=int, default=200_000)
    parser.add_argument("--games", type=int, default=500, help="that are judged (default: %(default)s)")
    parser.add_argument("--opponent", default="still")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)

    env = gymnasium.make("apollonius/Pursuit-v0", opponent=options.opponent)
    learner = DQN(
        "MlpPolicy", env, learning_rate=5e-4, buffer_size=100_000, batch_size=64, learning_starts=5_000, train_freq=8,
        target_update_interval=2_000, exploration_fraction=0.3, seed=options.seed, policy_kwargs={"net_arch": [64, 64]},
    )  # fmt: skip
    learner.learn(options.env_steps)

    captured = 0
    for game in range(options.games):
        seen, _ = env.reset(seed=UNSEEN + game)
        over, info = False, {}
        while not over:
            action, _ = learner.predict(seen, deterministic=True)
            seen, _, terminated, truncated, info = env.step(int(action))
            over = terminated or truncated
        captured += info["outcome"] == "captured"
    print(f"{captured / options.games:.1%} of {options.games} games captured")
    return captured / options.games


if __name__ == "__main__":
    main()
