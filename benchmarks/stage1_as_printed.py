"""Stage 1 as printed: values of starts against returns, and captures, in the course of training.

    apollonius train --preset paper --profile paper --stage fixed-target --seed 2 --out RUN
    python benchmarks/stage1_as_printed.py look RUN ... --out FILE
    python benchmarks/stage1_as_printed.py draw FILE --out PICTURE

Each agent that a run has saved plays greedily against a standing evader, from starts that no
training draws. The value of a start is the network's best action value; the return is what the
agent gets from it by the rewards, the discount and the time limit of its training.
"""

import argparse
import json
import re
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius import Match, Outcome, Role, look, reset_batch
from apollonius.agents.network import QNetwork
from apollonius.agents.store import load_agent
from apollonius.evaluate.match import count_results, play_games
from apollonius.game.game import Game
from apollonius.game.types import GameState
from apollonius.io.document import write_atomically
from apollonius.learn.fixed_target import FixedTargetConfig
from apollonius.learn.folder import agent_file, load_config
from apollonius.learn.metrics import load_metrics
from apollonius.show import palette, style

STARTS, HELD_OUT = 500, 777
BRAKE = jnp.int32(1)
"""Action of the evader."""


class _Course(NamedTuple):
    """A game so far: its state, the weight of the next reward, and the discounted rewards."""

    state: GameState
    weight: Float[Array, ""]
    total: Float[Array, ""]


@eqx.filter_jit
def values_and_returns(
    network: QNetwork, game: Game, gamma: float
) -> tuple[Float[Array, " starts"], Float[Array, " starts"]]:
    """Return the value that a network gives each start, and its discounted return from there."""

    def action_values(state: GameState) -> Float[Array, "9"]:
        return network(network.observation(look(game, state, Role.PURSUER)))

    def one_step(course: _Course, _: None) -> tuple[_Course, None]:
        action = jnp.argmax(action_values(course.state)).astype(jnp.int32)
        after = game.step(course.state, action, BRAKE)
        total = course.total + course.weight * after.reward.pursuer
        weight = course.weight * gamma * (after.outcome == Outcome.ONGOING)
        return _Course(after.state, weight, total), None

    def play(state: GameState) -> tuple[Float[Array, ""], Float[Array, ""]]:
        start = _Course(state, jnp.float32(1), jnp.float32(0))
        end, _ = jax.lax.scan(one_step, start, length=1000)
        return jnp.max(action_values(state)), end.total

    return jax.vmap(play)(reset_batch(game, jax.random.key(HELD_OUT), STARTS))


def look_at(run: Path, games: int) -> list[dict[str, float]]:
    """Return a row for each agent that a run saved in the course of stage 1."""
    config = load_config(run / "config.toml")
    stage = config.stages[0]
    assert isinstance(stage, FixedTargetConfig)
    name = config.agent_name(stage.kind, Role.PURSUER)
    game = stage.game_of_training(config.game)
    lines = load_metrics(run / "metrics.jsonl")
    rows: list[dict[str, float]] = []
    for percent in saved_percentages(run, name):
        file = agent_file(run, name, percent)
        network = load_agent(file).network
        assert isinstance(network, QNetwork)
        values, returns = values_and_returns(network, game, config.algorithm.gamma)
        match = Match.of_names(config.game, str(file), "still", games=games, seed=HELD_OUT)
        captured = count_results(match, play_games(match)).outcomes["captured"]
        env_steps = stage.env_steps * percent / 100
        line = min(lines, key=lambda line: abs(line.env_steps - env_steps))
        rows.append(
            {
                "env_steps": line.env_steps,
                "episodes": line.episodes,
                "value": round(float(values.mean()), 3),
                "return": round(float(returns.mean()), 3),
                "captured": captured / games,
            }
        )
        print(run.name, json.dumps(rows[-1]), flush=True)
    return rows


def saved_percentages(run: Path, name: str) -> list[int]:
    """Return the percentages of the stage after which an agent was saved."""
    matches = (re.search(rf"{name}-(\d+)$", file.stem) for file in (run / "agents").iterdir())
    return sorted(int(match[1]) for match in matches if match)


def draw(curves: dict[str, list[dict[str, float]]], path: Path) -> None:
    """Draw values and returns of each run, and its captures."""
    colours = palette.PURSUER, palette.EVADER, palette.OBSTACLE, palette.OTHER
    with style.picture(path, columns=2, width=4.2, height=3.2) as (values, captures):
        for (name, rows), colour in zip(curves.items(), colours, strict=False):
            steps = [row["env_steps"] / 1e6 for row in rows]
            values.plot(steps, [row["value"] for row in rows], color=colour)
            values.plot(steps, [row["return"] for row in rows], ":", color=colour)
            shares = [100 * row["captured"] for row in rows]
            captures.plot(steps, shares, color=colour, label=name)
        values.set(title="value of starts (dotted: the return)", xlabel="million env steps")
        captures.set(title="standing evaders captured [%]", xlabel="million env steps")
        captures.set_ylim(0, 100)
        captures.legend(loc="lower right")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    looking = commands.add_parser("look")
    looking.add_argument("runs", type=Path, nargs="+")
    looking.add_argument("--games", type=int, default=1000, help="default: %(default)s")
    looking.add_argument("--out", type=Path, required=True)
    drawing = commands.add_parser("draw")
    drawing.add_argument("file", type=Path)
    drawing.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    if options.command == "draw":
        draw(json.loads(options.file.read_text(encoding="utf-8")), options.out)
        return
    curves = {run.name: look_at(run, options.games) for run in options.runs}
    write_atomically(options.out, (json.dumps(curves, indent=1) + "\n").encode())


if __name__ == "__main__":
    main()
