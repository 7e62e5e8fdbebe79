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

if TYPE_CHECKING:
    from apollonius.evaluate.match import Match, MatchResult
    from apollonius.learn.config import RunConfig
    from apollonius.learn.metrics import MetricsLine, Tracker
    from apollonius.learn.stage import StageConfig

ALGORITHMS = ("dqn", "sac")
PROFILES = ("fast", "paper")
SCHEMES = ("latest", "uniform", "prioritised-hard")
STAGES = ("fixed-target", "self-play", "both")


def add_train(parser: argparse.ArgumentParser) -> None:
    _add_learning_options(parser)
    _add_sweep_options(parser)
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


def _add_learning_options(parser: argparse.ArgumentParser) -> None:
    beginning = parser.add_mutually_exclusive_group()
    beginning.add_argument(
        "--preset", choices=LENGTHS, default="quick", help="length of training (default: quick)"
    )
    beginning.add_argument(
        "--config", type=existing_file, help="a config.toml to start from instead of a preset"
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


def _add_sweep_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--seeds", type=seeds, help="a run for each of several seeds, as 0-9 or 0,3,7"
    )
    parser.add_argument(
        "--vary",
        type=swept_field,
        action="append",
        default=[],
        metavar="FIELD=VALUES",
        help="a run for each value of a field of config.toml: algorithm.batch=64,128 or "
        "FIELD=FROM:TO:COUNT; several for all combinations",
    )
    add_workers(parser, "the runs of a sweep")


def add_resume(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "folder", type=runs_folder, metavar="DIR", help="folder of a run, or of several"
    )
    add_workers(parser, "the runs of a sweep")
    parser.set_defaults(run=run_resume, track=None)


def run_train(options: argparse.Namespace) -> int:
    from apollonius.learn.folder import create_run
    from apollonius.learn.run import require_agents

    config = _requested_config(options)
    is_sweep = bool(options.vary or options.seeds)
    configs = _swept_configs(config, options) if is_sweep else {"": config}
    name = options.config.stem if options.config else options.preset
    stages = "both" if len(config.stages) > 1 else next(iter(config.by_name))
    suffix = "sweep" if is_sweep else config.seed
    folder: Path = options.out or Path("runs") / f"{name}-{stages}-{suffix}"
    for run_config in configs.values():
        require_agents(run_config)  # before anything is written
    if is_sweep and folder.exists():
        is_new = options.force or not any(folder.iterdir())
        bound = "a new folder, as this one is not empty; choose another or force it"
        require(is_new, "--out", folder, bound)
    several = is_sweep or bool(options.on)
    bound = "left out here; apollonius track sends runs"
    require(options.track is None or not several, "--track", options.track, bound)
    for name, run_config in configs.items():
        create_run(run_config, folder / name, force=options.force)
    if several:
        return train_all([folder / name for name in configs], folder, options)
    return _train_and_judge(config, folder, options)


def _swept_configs(config: "RunConfig", options: argparse.Namespace) -> "dict[str, RunConfig]":
    """Return the configs of a sweep, by the names of their runs."""
    from apollonius.learn.config import sweep

    is_one_seed = options.seed is None or not options.seeds
    require(is_one_seed, "--seed", options.seed, "left out with --seeds")
    values = dict(options.vary) | ({"seed": options.seeds} if options.seeds else {})
    fields = [*(field for field, _ in options.vary), *(["seed"] if options.seeds else [])]
    require(len(fields) == len(values), "--vary", ", ".join(fields), "of different fields")
    return sweep(config, values)


def run_resume(options: argparse.Namespace) -> int:
    from apollonius.evaluate.pairings import EVALUATION
    from apollonius.learn.folder import load_config
    from apollonius.learn.progress import progress_of, runs_below

    def is_over(run: Path) -> bool:
        if progress_of(run).state.state != "finished":
            return False
        return (run / EVALUATION).is_file() or not load_config(run / "config.toml").is_judged

    folder: Path = options.folder
    runs = runs_below(folder)
    if runs == [folder] and options.on is None:
        return _train_and_judge(load_config(folder / "config.toml"), folder, options)
    return train_all([run for run in runs if not is_over(run)], folder, options)


def _requested_config(options: argparse.Namespace) -> "RunConfig":
    """Return the preset or file with the changes of the command line."""
    from dataclasses import replace

    from apollonius.arenas.file import find_game
    from apollonius.learn.config import (
        FIXED_TARGET,
        PRESETS,
        SELF_PLAY,
        change_stages,
        with_profile,
    )
    from apollonius.learn.dqn import DQNConfig
    from apollonius.learn.folder import load_config
    from apollonius.learn.sac import SACConfig

    config = load_config(options.config) if options.config else PRESETS[options.preset]
    kind = options.algorithm or config.algorithm.kind
    bound = f"left out with {kind}, whose numbers a --config says"
    require(options.profile is None or kind == "dqn", "--profile", options.profile, bound)
    if kind != config.algorithm.kind:
        config = replace(config, algorithm=SACConfig() if kind == "sac" else DQNConfig())
    if options.profile:
        config = with_profile(config, options.profile)
    if options.stage in (FIXED_TARGET, SELF_PLAY):
        config = replace(config, stages=_chosen_stages(config, options.stage))
    if options.opponents:
        has_self_play = any(stage.kind == SELF_PLAY for stage in config.stages)
        bound = "left out where no stage is self-play"
        require(has_self_play, "--opponents", options.opponents, bound)
        config = change_stages(config, SELF_PLAY, opponents=options.opponents)
    changes: dict[str, Any] = {
        "seed": options.seed,
        "game": find_game(options.game) if options.game else None,
    }
    return replace(config, **{key: value for key, value in changes.items() if value is not None})


def _chosen_stages(config: "RunConfig", kind: str) -> "tuple[StageConfig, ...]":
    """Return the stages of one kind; raises InvalidInput for a training without one."""
    stages = tuple(stage for stage in config.stages if stage.kind == kind)
    bound = f"one of this training, {', '.join(config.by_name)}"
    require(stages, "--stage", kind, bound)
    return stages


def _train_and_judge(config: "RunConfig", folder: Path, options: argparse.Namespace) -> int:
    """Train to the end or to Ctrl-C; at the end judge the new agents."""
    from apollonius.learn.folder import agent_file

    _train(config, folder, options)
    if config.is_judged:
        _judge(config, folder, options)
        then = shell_command("report", folder)
    else:
        name, stage = list(config.by_name.items())[-1]
        role = stage.roles[0]
        agent = agent_file(folder, config.agent_name(name, role))
        then = shell_command("exploit", role.name.lower(), agent)
    print_next_step(options, folder, then=then)
    return 0


def _train(config: "RunConfig", folder: Path, options: argparse.Namespace) -> None:
    """Train to the end; raises KeyboardInterrupt after a Ctrl-C."""
    from apollonius.learn.distillation import TABLES
    from apollonius.learn.metrics import Tracker
    from apollonius.learn.run import TrainingRun

    trackers = list[Tracker]()
    display = options.display

    def report(line: "MetricsLine", share: float) -> None:
        display.report(share, 1.0)
        display.note({"stage": line.stage} | training_notes(line))
        _send(line, trackers, folder, options)

    run = TrainingRun(config, folder, report)
    set_resume_hint(f"go on with: apollonius resume {folder}")
    for stage in config.stages:
        for game, grid in stage.games_to_solve(config.game):
            solved_game(display, game, grid, folder / TABLES)
    trackers += [Tracker(options.track, folder, config)] if options.track else []
    display.begin_task("training")
    try:
        with stopping_on_signals():
            is_finished = run.execute()
    finally:
        for track in trackers:
            track.close()
    if not is_finished:
        raise KeyboardInterrupt


def _send(
    line: "MetricsLine", trackers: "list[Tracker]", folder: Path, options: argparse.Namespace
) -> None:
    """Send metrics to the trackers, except to one that has failed."""
    for track in trackers:
        try:
            track(line)
        except Exception as error:  # of any kind: each library has its own
            trackers.clear()
            to = options.track
            remedy = f"apollonius track {folder} --to {to} sends all afterwards"
            options.display.print_line(f"{to} takes no more ({error}); {remedy}")


def _judge(config: "RunConfig", folder: Path, options: argparse.Namespace) -> None:
    """Play the evaluation's matches and print their results and the learning curves."""
    from apollonius.evaluate.learning import learning_curves
    from apollonius.evaluate.pairings import evaluate_run

    display = options.display

    def print_match(match: "Match", result: "MatchResult") -> None:
        print(match_table(match, result), end="\n\n", flush=True)

    display.begin_task("judging")
    evaluate_run(folder, config.game, print_match, display.report)
    print(learning_table(learning_curves(folder, config, display.report)), end="\n\n", flush=True)
