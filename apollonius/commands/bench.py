"""`apollonius bench`: speed on this machine."""

import argparse
import json
from typing import Any

from apollonius.commands.values import count, named
from apollonius.errors import require
from apollonius.limits import BENCHED_GAMES

BENCHES = ("classic", "fast", "paper")
"""Profiles of training that are measured."""
PAPER = "paper"
"""The game and the observation that are measured where no others are named."""


def add_bench(subparsers: Any) -> None:
    """The parser of `bench`."""
    parser = subparsers.add_parser("bench", help="measure speed on this machine")
    parser.add_argument("what", choices=("env", "train"), help="random play, or training")
    parser.add_argument(
        "--games", type=count(BENCHED_GAMES), help="games at a time (default: 4096 for env, the profile's for train)"
    )
    parser.add_argument(
        "--profile",
        choices=BENCHES,
        default="classic",
        help="for train: classic (batch 128, an update every 4 env steps; default), fast or paper",
    )
    parser.add_argument(
        "--stage",
        choices=("fixed-target", "self-play"),
        default="fixed-target",
        help="for train: the pursuer learns against a standing evader (default), or both sides learn",
    )
    parser.add_argument(
        "--game",
        type=named,
        default="paper",
        help="for env: a .toml file, or the name of a game (default: %(default)s)",
    )
    parser.add_argument("--observation", type=named, default=PAPER, help="for env (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.set_defaults(run=run_bench)


def run_bench(options: argparse.Namespace) -> int:
    """Measure and print."""
    from dataclasses import replace

    from apollonius.bench.play import bench_env
    from apollonius.bench.training import CLASSIC, bench_train
    from apollonius.learn.learner_config import PROFILES

    for name in ("game", "observation"):
        given = getattr(options, name)
        require(
            options.what == "env" or given == PAPER, f"--{name}", given, f"left out: training is in the {PAPER} game"
        )
    display = options.display
    display.begin(f"measuring {options.what}", compiles=True)
    if options.what == "env":
        games = 4096 if options.games is None else options.games
        result = bench_env(games, report=display.report, game=options.game, observation=options.observation)
    else:
        profiles = {"classic": CLASSIC, **PROFILES}
        config = profiles[options.profile]
        config = config if options.games is None else replace(config, games=options.games)
        result = bench_train(config, report=display.report, stage=options.stage)
    display.end()
    if options.json:
        print(json.dumps(result))
    else:
        for key, value in result.items():
            digits = f",.{0 if value >= 100 else 2}f" if isinstance(value, float) else ""
            print(f"{key:<30} {value:{digits}}")
    return 0
