"""Time to the paper's result: seconds of a core until a pursuer catches 96 % of standing evaders.

    taskset -c 0 python benchmarks/time_to_96.py --learners apollonius jax-ppo sb3-ppo sb3-dqn
    --seeds 10 --out FILE

Each learner trains in the `paper` game with the observation `encoded`, in a process of its own, one
learner after the other for each seed. After every two seconds of training it plays 2,000 games
without exploration, from starts that no training draws; the clock stands meanwhile. Compiling
counts, imports do not. Peers: pip install stable-baselines3.
"""

import argparse
import json
import math
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

import apollonius
from apollonius import Outcome, Role

GAME = apollonius.make_game("paper")
OBSERVATION = apollonius.find_observation("encoded")
GOAL = 0.96
GAMES = 2000
HELD_OUT = 777
INTERVAL = 2.0
"""Seconds of a core between two looks."""
BRAKE = jnp.int32(1)
"""Action of the evader."""
Layers = Sequence[tuple[Any, Any]]
"""Weights `[out, in]` and biases `[out]` of a network whose largest output is the action."""
Network = tuple[str, Layers]
"""A network's activation and layers."""


def observe(state: apollonius.GameState) -> Float[Array, " size"]:
    """Return the pursuer's observation."""
    return OBSERVATION(apollonius.look(GAME, state, Role.PURSUER))


def action_of(
    activation: str, layers: Layers, observation: Float[Array, " size"]
) -> Int[Array, ""]:
    """Return the action of the largest output."""
    inner = {"relu": jax.nn.relu, "tanh": jnp.tanh}[activation]
    for weight, bias in layers[:-1]:
        observation = inner(weight @ observation + bias)
    weight, bias = layers[-1]
    return jnp.argmax(weight @ observation + bias)


def captured(activation: str, layers: Layers, states: apollonius.GameState) -> Int[Array, ""]:
    """Count the games from these states that end in a capture."""

    def play(state: apollonius.GameState) -> Int[Array, ""]:
        def one_step(carry: tuple[Any, Any], _: None) -> tuple[tuple[Any, Any], None]:
            state, outcome = carry
            action = action_of(activation, layers, observe(state))
            after = GAME.step(state, action, BRAKE)
            over = outcome != Outcome.ONGOING
            state = jax.tree.map(lambda old, new: jnp.where(over, old, new), state, after.state)
            return (state, jnp.where(over, outcome, after.outcome)), None

        first = state, jnp.int32(Outcome.ONGOING)
        (_, outcome), _ = jax.lax.scan(one_step, first, length=int(GAME.max_steps))
        return outcome

    return jnp.sum(jax.vmap(play)(states) == Outcome.CAPTURED)


class Watch:
    """Seconds of a training, without those of its looks, and what each look saw.

    A learner calls it as often as it likes with its env steps and the network that would play; True
    tells it to stop.
    """

    def __init__(self, limit: float) -> None:
        self.limit = limit
        self.looks: list[dict[str, float]] = []
        self.starts = apollonius.reset_batch(GAME, jax.random.key(HELD_OUT), GAMES)
        self.count = jax.jit(captured, static_argnums=0)
        self.last = 0.0
        self.wall = time.perf_counter()
        self.core = time.process_time()

    def __call__(self, env_steps: int, network: Network) -> bool:
        wall = time.perf_counter() - self.wall
        core = time.process_time() - self.core
        if core - self.last < INTERVAL:
            return False
        share = int(self.count(*network, self.starts)) / GAMES
        look = {
            "core_seconds": core,
            "wall_seconds": wall,
            "env_steps": env_steps,
            "captured": share,
        }
        self.looks.append(look)
        self.last = core
        self.wall = time.perf_counter() - wall
        self.core = time.process_time() - core
        return share >= GOAL or core > self.limit


def apollonius_dqn(seed: int, watch: Watch) -> None:
    """Train by the preset `quick`, as `apollonius train` does."""
    from apollonius.learn.config import PRESETS

    config = PRESETS["quick"]
    stage_1 = config.stages[0].make(config.algorithm, GAME)
    state = stage_1.init(jax.random.fold_in(jax.random.key(seed), 0))
    for _ in range(stage_1.chunks):
        state, _ = stage_1.step(state)
        layers = state.learners[Role.PURSUER].learner.average.layers
        network = "relu", [(layer.weight, layer.bias) for layer in layers]
        if watch(int(state.env_steps), network):
            return


def jax_ppo(seed: int, watch: Watch) -> None:
    """Train by proximal policy optimisation, one file of JAX."""
    import peers_jax

    peers_jax.train(GAME, observe, seed, watch)


def sb3_dqn(seed: int, watch: Watch) -> None:
    """Train by the DQN of Stable-Baselines3, in 32 games at a time."""
    import peers_sb3

    peers_sb3.train_dqn(seed, watch)


def sb3_ppo(seed: int, watch: Watch) -> None:
    """Train by the PPO of Stable-Baselines3, in 256 games at a time."""
    import peers_sb3

    peers_sb3.train_ppo(seed, watch)


LEARNERS = {
    "apollonius": apollonius_dqn,
    "jax-ppo": jax_ppo,
    "sb3-ppo": sb3_ppo,
    "sb3-dqn": sb3_dqn,
}


def race(learner: str, seed: int, limit: float) -> dict[str, Any]:
    """Train one learner from one seed; return the seconds it took, None if it did not arrive, and
    all looks.
    """
    watch = Watch(limit)
    LEARNERS[learner](seed, watch)
    arrival = watch.looks[-1]
    arrived = arrival["captured"] >= GOAL
    return {
        "learner": learner,
        "seed": seed,
        "core_seconds": arrival["core_seconds"] if arrived else None,
        "wall_seconds": arrival["wall_seconds"] if arrived else None,
        "env_steps": arrival["env_steps"],
        "captured": arrival["captured"],
        "looks": watch.looks,
    }


def in_process(learner: str, seed: int, limit: float) -> dict[str, Any]:
    """Run `race` in a process of its own."""
    command = [
        sys.executable,
        __file__,
        "--one",
        learner,
        "--seed",
        str(seed),
        "--limit",
        str(limit),
    ]
    process = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True)
    answer: dict[str, Any] = json.loads(process.stdout.splitlines()[-1])
    return answer


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return a line for each learner: how many arrived, median and worst seconds of a core."""
    lines = ["learner       arrived   median s   worst s   median env steps"]
    for learner in dict.fromkeys(row["learner"] for row in rows):
        own = [row for row in rows if row["learner"] == learner]
        seconds = [row["core_seconds"] or math.inf for row in own]
        arrived = sum(map(math.isfinite, seconds))
        steps = statistics.median(row["env_steps"] for row in own)
        median = statistics.median(seconds)
        lines.append(
            f"{learner:12} {arrived:3} of {len(own):2} {median:10.1f} {max(seconds):9.1f} "
            f"{steps:18,.0f}"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--learners", nargs="+", choices=LEARNERS, default=list(LEARNERS))
    parser.add_argument("--seeds", type=int, default=10, help="how many (default: %(default)s)")
    parser.add_argument(
        "--limit", type=float, default=600.0, help="seconds of a core (default: %(default)s)"
    )
    parser.add_argument("--out", type=Path, help="where the figures go, as JSON")
    parser.add_argument("--one", choices=LEARNERS, help="this learner alone, in this process")
    parser.add_argument("--seed", type=int, default=0, help="of --one (default: %(default)s)")
    options = parser.parse_args()
    if options.one:
        print(json.dumps(race(options.one, options.seed, options.limit)))
        return
    rows: list[dict[str, Any]] = []
    for seed in range(options.seeds):
        for learner in options.learners:
            row = in_process(learner, seed, options.limit)
            rows.append(row)
            print(
                f"{learner} seed {seed}: {row['core_seconds']} s of a core, {row['captured']:.1%}",
                flush=True,
            )
            if options.out:
                options.out.write_text(json.dumps(rows) + "\n", encoding="utf-8")
    print(table(rows))


if __name__ == "__main__":
    main()
