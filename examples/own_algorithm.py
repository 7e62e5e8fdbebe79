"""Train by an algorithm of your own: Munchausen deep Q-learning, from one file.

    python examples/own_algorithm.py

Each reward is raised by the log probability of the action (Vieillard, Pietquin and Geist, 2020).
The run is a folder with checkpoints, metrics, agents and a report, as of `apollonius train`. Start
the script again after Ctrl-C: it continues to the same bits.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import optax

import apollonius
from apollonius.agents.network import QNetwork, interpolate_weights, make_network
from apollonius.agents.trained import EpsilonGreedy, Greedy
from apollonius.learn.algorithm import interpolate_linearly
from apollonius.learn.config import PRESETS
from apollonius.learn.folder import create_run
from apollonius.learn.replay_algorithm import ReplayAlgorithm
from apollonius.learn.run import TrainingRun
from apollonius.show.report import report_of, save_report

ADAM = optax.scale_by_adam()


class Learner(eqx.Module):
    """Networks and optimiser; `average` lags behind: it is the target and what is judged."""

    network: QNetwork
    average: QNetwork
    optimiser: Any
    updates: Any


@dataclass(frozen=True)
class Munchausen(ReplayAlgorithm):
    """Munchausen deep Q-learning, for the nine discrete actions."""

    kind: Literal["munchausen"] = "munchausen"
    averaging: float = 0.005
    temperature: float = 0.03
    bonus: float = 0.9
    n_step: int = 1
    final_n_step: int = 1

    def init_learner(self, key, network=None):
        first = network or make_network(self.observation, self.width, self.depth, key)
        own, average = (jax.tree.map(jnp.copy, first) for _ in range(2))
        return Learner(own, average, ADAM.init(eqx.filter(own, eqx.is_array)), jnp.int32(0))

    def exploration(self, first, stage_env_steps, env_steps):
        return interpolate_linearly(first, 0.02, 0.1 * stage_env_steps, env_steps)

    def explorer(self, network, exploration):
        return EpsilonGreedy(Greedy(network), exploration)

    def update(self, learner, batch, learning_rate, key):
        def of_actions(rows):
            return jnp.take_along_axis(rows, batch.action[:, None], axis=1)[:, 0]

        tau, next_values = self.temperature, learner.average.batch(batch.next_observation)
        log_policy = jax.nn.log_softmax(learner.average.batch(batch.observation) / tau)
        next_log_policy = jax.nn.log_softmax(next_values / tau)
        soft = jnp.exp(next_log_policy) * (next_values - tau * next_log_policy)
        extra = self.bonus * jnp.clip(tau * of_actions(log_policy), -1.0, 0.0)
        targets = batch.reward + extra + batch.discount * jnp.sum(soft, axis=1)

        def loss(network):
            return jnp.mean((targets - of_actions(network.batch(batch.observation))) ** 2)

        error, gradient = eqx.filter_value_and_grad(loss)(learner.network)
        direction, optimiser = ADAM.update(gradient, learner.optimiser)
        steps = jax.tree.map(lambda step: -learning_rate * step, direction)
        network = eqx.apply_updates(learner.network, steps)
        average = interpolate_weights(learner.average, network, self.averaging)
        return Learner(network, average, optimiser, learner.updates + 1), error


apollonius.register_algorithm(Munchausen)


def main(env_steps: int = 8_000_000, games: int = 500, out: str = "runs/own", **numbers) -> None:
    """Train stage 1 in a folder, new or begun, and write the report."""
    stage_1 = replace(PRESETS["quick"].stages[0], env_steps=env_steps, evaluation_games=games)
    algorithm = Munchausen(**{"width": 128, "depth": 3, "learning_rate": 1e-3} | numbers)
    config = replace(PRESETS["quick"], algorithm=algorithm, stages=(stage_1,))
    folder = Path(out)
    if not folder.exists():
        create_run(config, folder)

    def report(line, share):
        if line.evaluation is not None:
            print(f"{share:4.0%}  {line.evaluation.pursuer_win_rate:6.1%} captured")

    TrainingRun(config, folder, report).execute()
    save_report(report_of(folder), folder / "report.html")


if __name__ == "__main__":
    main()
