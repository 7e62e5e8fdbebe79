"""How soon stage 1 is learned to 90 %: Apollonius, and Stable-Baselines3's DQN on the same game through Gymnasium.

    pip install '.[gym]' stable-baselines3
    taskset -c 0 python benchmarks/time_to_90.py --seconds 1200

Both learn the `paper` game with starts at rest, from the encoded observation and the rewards of stage 1, with four
hidden layers of 256 units, on the cores that the process may use. The same judge looks at both now and then: greedy
games against a standing evader. Seconds are the process's own (a busy machine does not count against it); imports,
compilation and the judge's games are not counted.
"""

import argparse
import json
import time
from collections.abc import Iterator

import equinox as eqx
import jax
import jax.numpy as jnp
import stable_baselines3  # pyright: ignore[reportMissingImports]
import torch  # pyright: ignore[reportMissingImports]
from stable_baselines3.common.callbacks import BaseCallback  # pyright: ignore[reportMissingImports]

from apollonius.adapters.gymnasium import OneSide
from apollonius.agents.greedy import Greedy
from apollonius.agents.kind import Named
from apollonius.agents.network import QNetwork, make_network
from apollonius.agents.pool import solo
from apollonius.catalogue import find_player
from apollonius.evaluate.match import Match, play_match
from apollonius.game.by_side import BySide
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.learn.fixed_target import start_fixed_target
from apollonius.learn.learner_config import PROFILES
from apollonius.learn.stage_config import StageConfig
from apollonius.learn.train_state import Plan
from apollonius.learn.train_step import play_and_learn

STAGE = StageConfig(env_steps=6_000_000)
GOAL = 0.90
GAMES = 1000
LOOKS = 40
"""Evaluations in the course of a training."""


def judge(network: QNetwork) -> float:
    """Share of captures of a standing evader, greedily, from starts that no training sees."""
    players = BySide(Named("ours", Greedy(network)), find_player("still", Role.EVADER))
    result = play_match(Match(make_game("paper"), players, GAMES, seed=90))
    return result.outcomes["captured"] / GAMES


def apollonius_curve(seed: int) -> Iterator[tuple[float, int, float]]:
    """Seconds of training, env steps and captures: stage 1, profile `fast`."""
    plan, game = Plan(PROFILES["fast"], STAGE), STAGE.rewarded(make_game("paper"))
    still = solo(find_player("still", Role.EVADER).policy)
    fixed = {Role.EVADER: still}

    def start(seed: int) -> object:
        return start_fixed_target(plan, game, jax.random.key(seed), still)

    jax.block_until_ready(play_and_learn(plan, game, start(seed + 1), fixed))  # compiled once, and thrown away
    state, spent = start(seed), 0.0
    for chunk in range(1, plan.chunks + 1):
        began = time.process_time()
        state, metrics = play_and_learn(plan, game, state, fixed)
        jax.block_until_ready(metrics)
        spent += time.process_time() - began
        if chunk * LOOKS % plan.chunks < LOOKS:
            yield spent, int(state.env_steps), judge(state.learners[Role.PURSUER].learner.average)


def stable_baselines_curve(seed: int, seconds: float) -> list[tuple[float, int, float]]:
    """The same of Stable-Baselines3's DQN, until it reaches the goal or its time is up."""
    curve: list[tuple[float, int, float]] = []
    game = STAGE.rewarded(make_game("paper"))
    env = OneSide(Role.PURSUER, opponent="still", game=game, observation="encoded")
    env.reset(seed=seed)
    env.step(0)  # compiled
    model = stable_baselines3.DQN(
        "MlpPolicy", env, learning_rate=5e-4, buffer_size=500_000, learning_starts=10_000, batch_size=128,
        train_freq=4, gradient_steps=1, target_update_interval=2_000,
        exploration_fraction=0.2, exploration_final_eps=0.02,
        policy_kwargs={"net_arch": [256] * 4, "activation_fn": torch.nn.ReLU}, seed=seed,
    )  # fmt: skip
    judge(as_network(model))  # compiled

    class Look(BaseCallback):  # pyright: ignore[reportUntypedBaseClass]
        """Stops the clock, judges, starts it again."""

        paused = 0.0

        def _on_training_start(self) -> None:
            self.began = self.last = time.process_time()

        def _on_step(self) -> bool:
            now = time.process_time()
            if now - self.last < seconds / LOOKS:
                return True
            curve.append((now - self.began - self.paused, self.num_timesteps, judge(as_network(model))))
            print_row("stable-baselines3", seed, *curve[-1])
            self.last = time.process_time()
            self.paused += self.last - now
            return curve[-1][2] < GOAL and curve[-1][0] < seconds

    model.learn(total_timesteps=2_000_000, callback=Look())
    return curve


def as_network(model: stable_baselines3.DQN) -> QNetwork:
    """Stable-Baselines3's network with our layers."""
    linear = [layer for layer in model.q_net.q_net if isinstance(layer, torch.nn.Linear)]
    weights = [jnp.asarray(part.detach().numpy()) for layer in linear for part in (layer.weight, layer.bias)]
    network = make_network("encoded", 256, 4, jax.random.key(0))
    return eqx.tree_at(
        lambda this: [part for layer in this.layers for part in (layer.weight, layer.bias)], network, weights
    )


def print_row(who: str, seed: int, seconds: float, env_steps: int, success: float) -> None:
    """One look as a line of JSON."""
    row = {"who": who, "seed": seed, "seconds": round(seconds, 1), "env_steps": env_steps, "captured": success}
    print(json.dumps(row), flush=True)


def main() -> None:
    """Train both, a line for each look, and the ratio at last."""
    parser = argparse.ArgumentParser(description="How soon stage 1 is learned to 90 %%.")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=1200.0, help="time given to Stable-Baselines3")
    options = parser.parse_args()
    torch.set_num_threads(1)
    ours = None
    for look in apollonius_curve(options.seed):
        print_row("apollonius", options.seed, *look)
        if look[2] >= GOAL:
            ours = look[0]
            break
    theirs, _, success = stable_baselines_curve(options.seed, options.seconds)[-1]
    ratio = theirs / ours if ours else None
    summary = {"apollonius": ours, "stable-baselines3": theirs, "captured at last": success, "ratio": ratio}
    print(json.dumps(summary))


if __name__ == "__main__":
    main()
