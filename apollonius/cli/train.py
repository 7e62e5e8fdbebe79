"""`apollonius train` and `resume`: train agents in a run's folder, then say how good they are."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.cli.options import LENGTHS, add_workers, print_next_step, shell_command
from apollonius.cli.runs import train_all
from apollonius.cli.solve import solved_game
from apollonius.cli.terminal import learning_table, match_table, training_notes
from apollonius.cli.values import (
    existing_file,
    existing_game,
    installed_extra,
    new_folder,
    runs_folder,
    seeds,
    swept_field,
    whole_number,
)
from apollonius.io.errors import TRACKERS, require
from apollonius.io.interrupts import set_resume_hint, stopping_on_signals
from apollonius.io.limits import SEED
from apollonius.learn.opponents import SCHEMES

if TYPE_CHECKING:
    from apollonius.evaluate.match import Match, MatchResult
    from apollonius.learn.config import RunConfig
    from apollonius.learn.metrics import MetricsLine

ALGORITHMS = ("dqn", "sac")
PROFILES = ("fast", "paper")
STAGES = ("fixed-target", "self-play", "both")


def add_train(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--preset", choices=LENGTHS, default="quick", help="length of training (default: quick)"
    )
    parser.add_argument("--stage", choices=STAGES, help="which stage to train (default: both)")
    parser.add_argument(
        "--algorithm",
        choices=ALGORITHMS,
        help="dqn: discrete actions (default); sac: continuous ones",
    )
    parser.add_argument(
        "--profile", choices=PROFILES, help="how DQN learns: fast (default), or paper, as printed"
    )
    parser.add_argument(
        "--game",
        type=existing_game,
        help="name of the game, or a .toml or .json file (default: paper)",
    )
    parser.add_argument(
        "--seed", type=whole_number(SEED), help="seed of everything random (default: 0)"
    )
    parser.add_argument(
        "--seeds", type=seeds, help="a run for each of several seeds, as 0-9 or 0,3,7"
    )
    parser.add_argument(
        "--vary", type=swept_field, action="append", default=[], metavar="FIELD=VALUES",
        help="a run for each value of a field of config.toml: dqn.learning_rate=1e-4,3e-4 or FIELD=FROM:TO:COUNT; "
        "several for all combinations",
    )  # fmt: skip
    add_workers(parser, "the runs of a sweep")
    parser.add_argument(
        "--config", type=existing_file, help="a config.toml to start from instead of a preset"
    )
    parser.add_argument(
        "--opponents",
        choices=SCHEMES,
        help="of both sides in self-play (default: latest, each other)",
    )
    parser.add_argument(
        "--out",
        type=new_folder,
        help="folder of the run or sweep (default: runs/PRESET-STAGE-SEED)",
    )
    parser.add_argument(
        "--force", action="store_true", help="overwrite a run that is already there"
    )
    about = "send the metrics of one run to a tracker meanwhile"
    parser.add_argument("--track", type=installed_extra, choices=TRACKERS, help=about)
    parser.set_defaults(run=run_train)


def add_resume(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "folder", type=runs_folder, metavar="DIR", help="folder of a run, or of several"
    )
    add_workers(parser, "the runs of a sweep")
    parser.set_defaults(run=run_resume, track=None)


def run_train(options: argparse.Namespace) -> int:
    from apollonius.catalogue import find_pool
    from apollonius.game.types import Role
    from apollonius.learn.config import sweep
    from apollonius.learn.folder import create_run
    from apollonius.learn.run import load_first_networks
    from apollonius.learn.training_task import require_players

    config = _requested_config(options)
    require(
        options.seed is None or not options.seeds, "--seed", options.seed, "left out with --seeds"
    )
    values = dict(options.vary) | ({"seed": options.seeds} if options.seeds else {})
    varied_names = [*(field for field, _ in options.vary), *(["seed"] if options.seeds else [])]
    require(
        len(varied_names) == len(values), "--vary", ", ".join(varied_names), "of different fields"
    )
    configs = sweep(config, values) if values else {"": config}
    name = options.config.stem if options.config else options.preset
    folder: Path = (
        options.out or Path("runs") / f"{name}-{config.stages}-{'sweep' if values else config.seed}"
    )
    for run_config in configs.values():
        # refused here, before anything is written
        find_pool(run_config.evaders, Role.EVADER, run_config.game)
        for role in Role:
            load_first_networks(run_config, role)
        if run_config.one_side is not None:
            require_players(run_config.one_side, run_config.game)
    if values and folder.exists():
        is_new = options.force or not any(folder.iterdir())
        require(
            is_new,
            "--out",
            folder,
            "a new folder, as this one is not empty; choose another or force it",
        )
    several = bool(values or options.on)
    require(
        options.track is None or not several,
        "--track",
        options.track,
        "left out here; apollonius track sends runs",
    )
    for name, run_config in configs.items():
        create_run(run_config, folder / name, force=options.force)
    if several:
        return train_all([folder / name for name in configs], folder, options)
    return _train_and_judge(config, folder, options)


def run_resume(options: argparse.Namespace) -> int:
    from apollonius.evaluate.pairings import EVALUATION
    from apollonius.learn.folder import load_config
    from apollonius.learn.progress import progress_of, runs_below

    def is_over(run: Path) -> bool:
        if progress_of(run).state.state != "finished":
            return False
        return (run / EVALUATION).is_file() or load_config(run / "config.toml").one_side is not None

    folder: Path = options.folder
    runs = runs_below(folder)
    if runs == [folder] and options.on is None:
        return _train_and_judge(load_config(folder / "config.toml"), folder, options)
    return train_all([run for run in runs if not is_over(run)], folder, options)


def _requested_config(options: argparse.Namespace) -> "RunConfig":
    """Return the preset or file with the changes of the command line."""
    from dataclasses import replace

    from apollonius.arenas.file import find_game
    from apollonius.learn.config import PRESETS, with_profile
    from apollonius.learn.folder import load_config
    from apollonius.learn.sac import SACConfig

    config = load_config(options.config) if options.config else PRESETS[options.preset]
    algorithm = options.algorithm or ("sac" if config.sac else "dqn")
    bound = "left out with --algorithm sac, whose numbers a --config says"
    require(options.profile is None or algorithm == "dqn", "--profile", options.profile, bound)
    config = replace(config, sac=(config.sac or SACConfig()) if algorithm == "sac" else None)
    if options.profile:
        config = with_profile(config, options.profile)
    self_play = config.self_play
    if options.opponents:
        self_play = replace(
            self_play, opponents=replace(self_play.opponents, scheme=options.opponents)
        )
    changes: dict[str, Any] = {
        "self_play": self_play,
        "stages": options.stage,
        "seed": options.seed,
        "game": find_game(options.game) if options.game else None,
    }
    return replace(config, **{key: value for key, value in changes.items() if value is not None})


def _train_and_judge(config: "RunConfig", folder: Path, options: argparse.Namespace) -> int:
    """Train to the end or to Ctrl-C; at the end judge the new agents."""
    from apollonius.arenas.suite import single_arena_games
    from apollonius.evaluate.learning import learning_curves
    from apollonius.evaluate.pairings import evaluate_run
    from apollonius.learn.folder import agent_file
    from apollonius.learn.metrics import Tracker
    from apollonius.learn.run import TrainingRun
    from apollonius.learn.teacher import TABLES

    trackers = list[Tracker]()
    display = options.display
    to = options.track

    def report(line: "MetricsLine", share: float) -> None:
        display.report(share, 1.0)
        display.note({"stage": line.stage} | training_notes(line))
        for track in trackers:
            try:
                track(line)
            except Exception as error:  # of any kind: each library has its own
                trackers.clear()
                display.print_line(
                    f"{to} takes no more ({error}); apollonius track {folder} --to {to} sends all afterwards"
                )

    def tell(match: "Match", result: "MatchResult") -> None:
        print(match_table(match, result), end="\n\n", flush=True)

    run = TrainingRun(config, folder, report)
    set_resume_hint(f"go on with: apollonius resume {folder}")
    if config.stages == "distillation" and config.distillation.solves:
        for game in single_arena_games(config.game):
            solved_game(display, game, config.distillation.grid, folder / TABLES)
    trackers += [Tracker(to, folder, config)] if to else []
    display.begin_task("training")
    try:
        with stopping_on_signals():
            is_finished = run.execute()
    finally:
        for track in trackers:
            track.close()
    if not is_finished:
        raise KeyboardInterrupt
    if config.one_side is not None:
        agent = agent_file(folder, f"{config.one_side.role[0].upper()}_{config.kind}")
        print_next_step(options, folder, then=shell_command("exploit", config.one_side.role, agent))
        return 0
    display.begin_task("judging")
    evaluate_run(folder, config.game, tell, display.report)
    print(learning_table(learning_curves(folder, config, display.report)), end="\n\n", flush=True)
    print_next_step(options, folder, then=shell_command("report", folder))
    return 0
