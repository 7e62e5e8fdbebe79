"""Self-play of both zoo agents for any arena on an accelerator: 257 arenas at once, two games of five in the paper's.

    python benchmarks/any_self_play.py --out runs/any-gpu

Both go on from the zoo and read `egocentric`. 600 million env steps took 11 minutes of an NVIDIA H100.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from apollonius.agents.network import QNetwork
from apollonius.agents.store import describe, save_agent
from apollonius.agents.trained import find_trained, load_network
from apollonius.arenas.charting import charted
from apollonius.arenas.file import find_game
from apollonius.arenas.suite import PAPERS_OWN, scenario_game, suite_arena, suite_names
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.scenario import Scenario, stack_arenas
from apollonius.game.types import Role
from apollonius.learn import loop
from apollonius.learn.learner_config import DQNConfig
from apollonius.learn.opponents import OpponentConfig
from apollonius.learn.stage_config import Plan, SelfPlayConfig
from apollonius.learn.train_state import start
from apollonius.observe.egocentric import EGOCENTRIC

GAMES = 8192
IN_PAPER = 0.4
"""Share of the games in the paper's arena, between the paper's robots."""


class Mixed(Scenario):
    """A scenario whose last arena is drawn more often, with the first kinds of robots."""

    def sample(self, key: Any) -> Any:
        of_arena, of_kind, of_own, of_other = jax.random.split(key, 4)
        last = jax.random.uniform(of_arena) < IN_PAPER
        kinds = 1 if self.kinds is None else len(self.kinds)
        own, other = jax.random.randint(of_kind, (), 0, PAPERS_OWN), jax.random.randint(of_own, (), 0, kinds)
        arena = jnp.where(last, self.count - 1, jax.random.randint(of_other, (), 0, self.count - 1))
        return arena + self.count * jnp.where(last, own, other)


def make_game() -> Game:
    """Return the rules in the training arenas of `suite-v1` and in the paper's, progress paid along paths."""
    game = scenario_game("suite-v1/train")
    arenas = [suite_arena("suite-v1", name) for name in suite_names("suite-v1", "train")] + [find_game("paper").arena]
    assert game.scenario is not None
    scenario = Mixed(stack_arenas(arenas), len(arenas), game.scenario.kinds)
    return charted(replace(game, scenario=scenario, reward=replace(game.reward, along_paths=True)))


def of_two(network: Any) -> QNetwork:
    """Return a network of `team` that reads `egocentric`: in a game of two its further inputs are zero."""
    first = network.layers[0]
    fresh = eqx.nn.Linear(EGOCENTRIC.size, first.out_features, key=jax.random.key(0))
    kept = first.weight[:, : EGOCENTRIC.size], first.bias
    return QNetwork((eqx.tree_at(lambda one: (one.weight, one.bias), fresh, kept), *network.layers[1:]), EGOCENTRIC)


def main() -> None:
    """Train both sides and write their agents."""
    parser = argparse.ArgumentParser(description="Self-play for any arena on an accelerator.")
    parser.add_argument("--env-steps", type=int, default=600_000_000)
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    learner = DQNConfig(
        observation="egocentric", gamma=0.995, games=GAMES, env_steps_per_update=GAMES // 4, batch=1024,
        learning_rate=3e-4, averaging=1e-3, replay_capacity=256 * GAMES, learning_starts=128 * GAMES,
        target_period=200 * GAMES, exploration_fraction=0.3, final_n_step=6,
    )  # fmt: skip
    past = OpponentConfig(scheme="prioritised-hard", renewal=2048 * GAMES)
    plan = Plan(learner, SelfPlayConfig(asked.env_steps, pursuer_epsilon=0.1, evader_epsilon=0.1, opponents=past))
    game = plan.stage.trained_in(make_game())
    networks = BySide(of_two(load_network("pursuer", Role.PURSUER)), load_network("evader", Role.EVADER))
    state = start(plan, game, jax.random.key(0), {}, networks)
    for after, _ in loop.chunks(plan, game, state, {}):
        state = after
    for role, side in state.learners.items():
        header = find_trained("pursuer" if role == Role.PURSUER else "evader")[0].header
        agent = describe(side.learner.average, role, header.game, {"env_steps": int(state.env_steps)})
        save_agent(agent, asked.out / f"{'PE'[role]}_gpu.safetensors")


if __name__ == "__main__":
    main()
