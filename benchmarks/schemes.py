"""Which self-play makes agents that lose least? Four schemes, as many trainings of each.

    python benchmarks/schemes.py train FILE --seeds 0-9      # 90 s of a core a training
    python benchmarks/schemes.py draw FILE --out docs/figures/schemes.png

All trainings of a seed go on from the same pursuer, which has learned to reach a standing evader,
by proximal policy optimisation with the same numbers and env steps. Each agent is judged by
opponents that were not trained with it: a response that learns to beat it, a planner that knows it,
the player by the solved game's table. A training is done by its scheme and its seed: a second call
does those that are missing.
"""

import argparse
import itertools
import json
import tempfile
import time
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import jax
import numpy as np

from apollonius import BySide, Match, NamedPlayer, Role, find_player, make_game
from apollonius.agents.network import Network
from apollonius.agents.trained import greedy_policy, load_network
from apollonius.arenas.charting import with_chart
from apollonius.evaluate.match import play_games
from apollonius.evaluate.solved import measure_card
from apollonius.evaluate.statistics import mean_interval, predict
from apollonius.exploit.attack import losses_of
from apollonius.exploit.attackers import planner_against
from apollonius.game.game import Game
from apollonius.io.document import write_atomically
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import agent_file, create_run, load_config
from apollonius.learn.ppo import PPOConfig
from apollonius.learn.response import ResponseConfig
from apollonius.learn.run import train
from apollonius.show import palette, style
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.solving import cached_tables

RECIPE = load_config(Path(__file__).parents[1] / "examples" / "recipes" / "magnet.toml")
"""The two stages of all trainings, and the numbers by which they learn."""
RESPONSE = 500_000
"""Env steps of a response."""
GAMES, PLANNED, SOLVED = 500, 20, 200
"""Games against a response, against the planner, and against the player by the solved game."""
GRID = (13, 13, 5, 8)
"""Nodes of the solved game."""
MAGNET = RECIPE.algorithm
assert isinstance(MAGNET, PPOConfig), "as the recipe says"
PPO = replace(MAGNET, magnet=0.0)
STAGE_1, SELF_PLAY = RECIPE.stages


@dataclass(frozen=True)
class Scheme:
    """How both sides learn, and whom they meet."""

    algorithm: PPOConfig
    opponents: str


SCHEMES = {
    "latest": Scheme(PPO, "latest"),
    "uniform": Scheme(PPO, "uniform"),
    "prioritised-hard": Scheme(PPO, "prioritised-hard"),
    "magnet": Scheme(MAGNET, "latest"),
}


def train_scheme(scheme: Scheme, seed: int, folder: Path) -> dict[Role, Path]:
    """Train both sides by a scheme; return the files of the agents."""
    first, run = folder / f"stage1-{seed}", folder / "self-play"
    if not agent_file(first, "P_stage1").exists():
        create_run(RunConfig(seed, algorithm=PPO, stages=(STAGE_1,)), first)
        train(first)
    config = RunConfig(
        seed,
        algorithm=scheme.algorithm,
        stages=(replace(SELF_PLAY, opponents=scheme.opponents),),
        pursuer=str(agent_file(first, "P_stage1")),
    )
    create_run(config, run, force=True)
    train(run)
    names = {Role.PURSUER: "P_curriculum", Role.EVADER: "E_curriculum"}
    return {role: agent_file(run, name) for role, name in names.items()}


def respond(game: Game, role: Role, files: dict[Role, Path], seed: int) -> Network:
    """Train a response to the agent of a side, from its opponent in training."""
    agent, opponent = str(files[role]), files[role.other]
    stage = ResponseConfig(
        env_steps=RESPONSE,
        role="evader" if role == Role.PURSUER else "pursuer",
        opponents=(agent,),
        failure=10.0,
    ).make(PPO, game)
    network = load_network(str(opponent), role.other)
    state = stage.init(jax.random.key(seed), BySide[Network | None].of(role.other, network, None))
    for _ in range(stage.chunks):
        state, _ = stage.step(state)
    return stage.agents(state)[role.other]


@cache
def judged_game() -> Game:
    """Return the game, with the chart that the planner reads."""
    return with_chart(make_game("paper"))


@cache
def tables() -> BySide[SaddlePolicy]:
    """Return the players by the solved game; solving it takes some minutes, once."""
    folder = Path(tempfile.gettempdir()) / "schemes-tables"
    return cached_tables(make_game("paper"), GRID, folder, played=judged_game())


def judge(role: Role, files: dict[Role, Path], seed: int) -> dict[str, Any]:
    """Return the losses of the agent of a side to each judge, and its regret."""
    game = judged_game()
    agent = find_player(str(files[role]), role, game)

    def match(judge: NamedPlayer, games: int) -> Match:
        return Match(game, BySide.of(role, agent, judge), games, seed=1)

    def fate(judge: NamedPlayer, games: int) -> dict[str, float]:
        results = play_games(match(judge, games), slots=min(games, 128))
        losses = losses_of(game, role, results)
        seconds = float(np.median(results.steps)) * float(game.dt)
        shares = {"loses": losses.loses, "fails": losses.fails, "wins": losses.wins}
        return {name: round(share, 4) for name, share in shares.items()} | {"seconds": seconds}

    response = NamedPlayer("response", greedy_policy(respond(game, role, files, seed)))
    planner = planner_against(agent, role, game)
    table = NamedPlayer("table", tables()[role.other])
    card = measure_card(match(table, SOLVED), tables()[role], tables()[role.other])
    return {
        "response": fate(response, GAMES),
        "planner": fate(NamedPlayer("planner", planner), PLANNED),
        "table": {"loses": card.lost, "wins": card.won, "regret": round(card.gap, 4)},
    }


def run_training(name: str, seed: int, folder: Path) -> dict[str, Any]:
    """Train and judge both agents of a scheme; return a row."""
    began = time.process_time()
    files = train_scheme(SCHEMES[name], seed, folder)
    trained = time.process_time()
    marks = {role.name.lower(): judge(role, files, seed) for role in Role}
    seconds = {"training": round(trained - began), "judging": round(time.process_time() - trained)}
    return {"scheme": name, "seed": seed, "processor seconds": seconds} | marks


def train_all(file: Path, seeds: range, names: list[str], folder: Path) -> None:
    """Do the trainings that a file lacks, seed by seed, and write each into it."""
    rows = read_rows(file) if file.is_file() else []
    done = {(row["scheme"], row["seed"]) for row in rows}
    for seed in seeds:
        for name in names:
            if (name, seed) in done:
                continue
            rows.append(run_training(name, seed, folder))
            print(json.dumps(rows[-1]), flush=True)
            write_rows(file, rows)


def read_rows(file: Path) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = json.loads(file.read_text(encoding="utf-8"))["trainings"]
    return rows


def write_rows(file: Path, rows: list[dict[str, Any]]) -> None:
    """Write the trainings, one a line."""
    lines = ",\n  ".join(json.dumps(row) for row in rows)
    head = f'"response": {RESPONSE}, "games": {[GAMES, PLANNED, SOLVED]}'
    write_atomically(file, f'{{\n {head},\n "trainings": [\n  {lines}\n ]\n}}\n'.encode())


def rates(rows: list[dict[str, Any]], side: str, judge: str) -> dict[str, list[float]]:
    """Return the shares of games that the trainings of each scheme lose to a judge."""
    return {
        name: [row[side][judge]["loses"] for row in rows if row["scheme"] == name]
        for name in SCHEMES
    }


def draw(rows: list[dict[str, Any]], picture: Path) -> None:
    """Draw what agents of both sides lose to a response and to the table."""
    panels = list(itertools.product(("pursuer", "evader"), ("response", "table")))
    with style.picture(picture, columns=len(panels), width=3.4, height=2.8) as axes:
        for panel, (side, judge) in zip(axes, panels, strict=True):
            lost = rates(rows, side, judge)
            columns = [[[value] for value in values] for values in lost.values()]
            intervals = [predict(np.array(column), 0.0, 1.0).interval for column in columns]
            colour = palette.SIDES[side == "evader"]
            names = [name.replace("-", "\n") for name in lost]
            style.draw_strips(panel, names, columns, intervals, [colour] * len(names))
            panel.set(title=f"{side} loses to the {judge}")


def summary(rows: list[dict[str, Any]]) -> list[str]:
    """Return a table: the mean of each scheme's losses with the prediction interval of another
    training, and its mean difference to `latest` over the seeds, with a 95 % interval.
    """
    lines = list[str]()
    for name in SCHEMES:
        cells = list[str]()
        for side, judge in itertools.product(("pursuer", "evader"), ("response", "table")):
            lost = rates(rows, side, judge)
            percents = 100 * np.array(lost[name])
            differences = percents - 100 * np.array(lost["latest"])
            prediction = predict(percents[:, None], 0.0, 100.0)
            cells.append(with_interval(prediction.mean, prediction.interval))
            cells.append(with_interval(differences.mean(), mean_interval(differences), "+"))
        lines.append(f"| `{name}` | {' | '.join(cells)} |")
    return lines


def with_interval(mean: float, interval: tuple[float, float], sign: str = "") -> str:
    low, high = interval
    return f"{mean:{sign}.0f} [{low:{sign}.0f}, {high:{sign}.0f}]"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", choices=("train", "draw"))
    parser.add_argument("file", type=Path)
    parser.add_argument("--seeds", default="0-4")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "schemes")
    parser.add_argument("--out", type=Path, default=Path("schemes.png"))
    options = parser.parse_args()
    if options.task == "draw":
        rows = read_rows(options.file)
        draw(rows, options.out)
        print("\n".join(summary(rows)))
        return
    first, _, last = options.seeds.partition("-")
    seeds = range(int(first), int(last or first) + 1)
    train_all(options.file, seeds, list(SCHEMES), options.folder)


if __name__ == "__main__":
    main()
