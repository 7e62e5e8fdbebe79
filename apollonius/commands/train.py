"""`apollonius train` and `resume`: train agents in a run's folder, then say how good they are."""

import argparse
import json
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.commands.ending import command, finish
from apollonius.commands.options import LENGTHS
from apollonius.commands.values import count, existing_file, existing_folder, named, new_folder
from apollonius.errors import require
from apollonius.interrupts import answer, go_on
from apollonius.limits import SEED

if TYPE_CHECKING:
    from apollonius.learn.config import RunConfig

ALGORITHMS = ("dqn", "sac")
PROFILES = ("fast", "paper")
STAGES = ("fixed-target", "self-play", "both")
SCHEMES = (
    "latest", "alternating", "uniform", "latest-80-20", "prioritised-hard", "prioritised-even", "gated", "psro",
    "psro-hedge", "league",
)  # fmt: skip


def add_train(subparsers: Any) -> None:
    """The parser of `train`."""
    parser = subparsers.add_parser("train", help="train a pursuer and an evader, then judge them")
    parser.add_argument(
        "--preset", choices=LENGTHS, default="quick",
        help="length of training: quick (minutes, default), standard or paper",
    )  # fmt: skip
    parser.add_argument("--stage", choices=STAGES, help="which stage to train (default: both)")
    parser.add_argument(
        "--algorithm", choices=ALGORITHMS, help="dqn: discrete actions (default); sac: continuous ones, smooth motion"
    )
    parser.add_argument(
        "--profile", choices=PROFILES, help="how DQN learns: fast (default) or paper (plain DQN as printed)"
    )
    parser.add_argument("--game", type=named, help="name of the game, or its .toml file (default: paper)")
    parser.add_argument("--seed", type=count(SEED), help="seed of everything random (default: 0)")
    parser.add_argument("--config", type=existing_file, help="a config.toml to start from instead of a preset")
    parser.add_argument(
        "--pursuer", type=named, help="agent that the pursuer of a lone --stage goes on from (default: none)"
    )
    parser.add_argument(
        "--evader",
        type=named,
        nargs="+",
        help="players that the pursuer of --stage fixed-target learns to catch (default: still), or the agent that the "
        "evader of --stage self-play goes on from (default: none)",
    )
    parser.add_argument(
        "--opponents", choices=SCHEMES, help="whom both sides of self-play meet (default: latest, each other)"
    )
    parser.add_argument("--out", type=new_folder, help="folder of the run (default: runs/PRESET-STAGE-SEED)")
    parser.add_argument("--force", action="store_true", help="overwrite a run that is already there")
    parser.set_defaults(run=run_train)


def add_resume(subparsers: Any) -> None:
    """The parser of `resume`."""
    parser = subparsers.add_parser("resume", help="go on with a training run that was stopped")
    parser.add_argument("folder", type=existing_folder, metavar="DIR", help="folder of the run")
    parser.set_defaults(run=run_resume)


def run_train(options: argparse.Namespace) -> int:
    """Train from scratch in a new folder."""
    from apollonius.agents.catalogue import find_pool
    from apollonius.game.types import Role
    from apollonius.learn.folder import create_run
    from apollonius.learn.run import load_first

    config = _requested_config(options)
    name = options.config.stem if options.config else options.preset
    folder: Path = options.out or Path("runs") / f"{name}-{config.stages}-{config.seed}"
    find_pool(config.evaders, Role.EVADER, config.game)  # refused here, before anything is written
    for role in Role:
        load_first(config, role)
    create_run(config, folder, force=options.force)
    return _train_and_judge(config, folder)


def run_resume(options: argparse.Namespace) -> int:
    """Go on from a run's checkpoint."""
    from apollonius.learn.folder import load_config

    return _train_and_judge(load_config(options.folder / "config.toml"), options.folder)


def _requested_config(options: argparse.Namespace) -> "RunConfig":
    """The preset or file, with what the command line changes."""
    from dataclasses import replace

    from apollonius.game.file import find_game
    from apollonius.learn.config import PRESETS
    from apollonius.learn.folder import load_config
    from apollonius.learn.learner_config import PROFILES, SACConfig

    config = load_config(options.config) if options.config else PRESETS[options.preset]
    algorithm = options.algorithm or ("sac" if config.sac else "dqn")
    bound = "left out with --algorithm sac, whose numbers a --config says"
    require(options.profile is None or algorithm == "dqn", "--profile", options.profile, bound)
    config = replace(config, sac=(config.sac or SACConfig()) if algorithm == "sac" else None)
    self_play = config.self_play
    if options.opponents:
        self_play = replace(self_play, opponents=replace(self_play.opponents, scheme=options.opponents))
    evaders: list[str] = options.evader or []
    goes_on = (options.stage or config.stages) == "self-play"
    require(not goes_on or len(evaders) < 2, "--evader", ", ".join(evaders), "one agent where --stage is self-play")
    changes: dict[str, Any] = {
        "self_play": self_play,
        "stages": options.stage,
        "seed": options.seed,
        "evaders": tuple(evaders) if evaders and not goes_on else None,
        "evader": evaders[0] if evaders and goes_on else None,
        "pursuer": options.pursuer,
        "dqn": PROFILES[options.profile] if options.profile else None,
        "game": find_game(options.game) if options.game else None,
    }
    return replace(config, **{key: value for key, value in changes.items() if value is not None})


def _train_and_judge(config: "RunConfig", folder: Path) -> int:
    """Train to the end or to Ctrl-C; at the end, play the new agents and say how good they are."""
    from apollonius.learn.run import Run
    from apollonius.terminal import TrainingDisplay

    interrupts: list[int] = []

    def on_interrupt(number: int, frame: object) -> None:
        interrupts.append(number)
        if len(interrupts) > 1:
            raise KeyboardInterrupt

    def should_stop() -> bool:
        if interrupts:
            answer()  # and then save where the training stands, however long that takes
        return bool(interrupts)

    go_on(f"go on with: apollonius resume {folder}")
    before = signal.signal(signal.SIGINT, on_interrupt)
    try:
        with TrainingDisplay() as display:
            finished = Run(config, folder, display, should_stop).execute()
    finally:
        signal.signal(signal.SIGINT, before)
    if not finished:
        raise KeyboardInterrupt
    _judge(config, folder)
    return 0


def _judge(config: "RunConfig", folder: Path, games: int = 2000) -> None:
    """Play the agents of a finished run; print the tables and keep them in `evaluation.json`."""
    from apollonius.agents.catalogue import find_agent
    from apollonius.agents.store import write_atomically
    from apollonius.evaluate.match import play_match
    from apollonius.evaluate.pairings import last_agents, pairings
    from apollonius.game.types import Role
    from apollonius.terminal import match_table

    agents = last_agents(folder)
    record = {}
    for name, opponent in pairings(agents):
        pursuer = find_agent(str(agents[name]), Role.PURSUER)
        evader = find_agent(str(agents.get(opponent, opponent)), Role.EVADER)
        result = play_match(config.game, pursuer.policy, evader.policy, games, seed=1)
        record[f"{name} against {opponent}"] = result.to_dict()
        print(match_table(name, opponent, result), end="\n\n")
    write_atomically(folder / "evaluation.json", json.dumps(record, indent=2).encode())
    finish(folder, then=command("report", folder))
