"""What each command does: it reads its options, calls, and prints. JAX is imported only by those that compute."""

import argparse
import json
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from apollonius.errors import InvalidInput, require

if TYPE_CHECKING:
    from apollonius.game.game import Game
    from apollonius.learn.config import RunConfig

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells use it."""


def run_train(options: argparse.Namespace) -> int:
    """Train from scratch in a new folder."""
    from apollonius.agents.catalogue import find_pool
    from apollonius.game.types import Role
    from apollonius.learn.folder import create_run
    from apollonius.learn.run import load_first_pursuer

    config = _requested_config(options)
    name = options.config.stem if options.config else options.preset
    folder: Path = options.out or Path("runs") / f"{name}-{config.stages}-{config.seed}"
    find_pool(config.evaders, Role.EVADER, config.game)  # refused here, before anything is written
    load_first_pursuer(config)
    create_run(config, folder, force=options.force)
    return _train_and_judge(config, folder)


def run_resume(options: argparse.Namespace) -> int:
    """Go on from a run's checkpoint."""
    from apollonius.learn.folder import load_config

    require(options.folder.is_dir(), "DIR", options.folder, "the folder of a training run; check the path")
    return _train_and_judge(load_config(options.folder / "config.toml"), options.folder)


def run_evaluate(options: argparse.Namespace) -> int:
    """Play a match and print its result."""
    from apollonius.agents.catalogue import find_agent
    from apollonius.evaluate.match import count, play_games, record_game, worst_first
    from apollonius.game.types import Role
    from apollonius.replay import save_replay
    from apollonius.terminal import match_table

    game = _requested_game(options)
    pursuer = find_agent(options.pursuer, Role.PURSUER, game)
    evader = find_agent(options.evader, Role.EVADER, game)
    require(0 <= options.record <= options.games, "--record", options.record, f"from 0 to --games = {options.games}")
    results = play_games(game, pursuer.policy, evader.policy, options.games, options.seed)
    result = count(game, results)
    if options.record:
        options.replays.mkdir(parents=True, exist_ok=True)
    for index in worst_first(results)[: options.record]:
        replay = record_game(game, pursuer, evader, options.games, options.seed, index)
        save_replay(replay, options.replays / f"game-{index}-{replay.outcome.name.lower()}.json")
    if options.json:
        match = {"pursuer": pursuer.name, "evader": evader.name, "game": options.game, "starts": options.starts}
        print(json.dumps(match | {"seed": options.seed} | result.to_dict()))
    else:
        print(match_table(pursuer.name, evader.name, result))
    return 0


def run_show(options: argparse.Namespace) -> int:
    """One game, drawn or written as a replay."""
    from apollonius.agents.catalogue import find_agent
    from apollonius.evaluate.match import record_game
    from apollonius.game.types import Role
    from apollonius.replay import load_replay, save_replay
    from apollonius.show.animation import FORMATS, save_animation

    known = (".png", *FORMATS, ".json")
    require(options.out.suffix in known, "--out", options.out, f"a file that ends in one of {', '.join(known)}")
    if options.evader is None:
        replay = load_replay(Path(options.pursuer))
        first = replay.first_difference()
        if first is not None:
            print(f"played again, this game differs from step {first} on", file=sys.stderr)
    else:
        game = _requested_game(options)
        pursuer = find_agent(options.pursuer, Role.PURSUER, game)
        replay = record_game(game, pursuer, find_agent(options.evader, Role.EVADER, game), 1, options.seed, 0)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    if options.out.suffix == ".json":
        save_replay(replay, options.out)
    elif options.out.suffix == ".png":
        with _plots():
            from apollonius.show.arena import save_picture
        save_picture(replay, options.out)
    else:
        save_animation(replay, options.out)
    steps, outcome = len(replay.actions), replay.outcome.name.lower().replace("_", " ")
    seconds = steps * float(replay.game.dt)
    print(f"{replay.pursuer} against {replay.evader}: {outcome} after {seconds:.1f} s ({steps} steps); {options.out}")
    return 0


def run_reproduce(options: argparse.Namespace) -> int:
    """Reproduce the paper's evaluation."""
    with _plots():
        from apollonius.experiments.reproduce import reproduce

    folder: Path = options.out or Path("runs") / f"reproduce-{options.budget}"
    again = f"apollonius reproduce --budget {options.budget} --seeds {options.seeds} --out {folder} --resume"
    if not reproduce(folder, options.budget, options.seeds, options.resume, options.games):
        print(f"stopped; go on with: {again}", file=sys.stderr)
        return INTERRUPTED
    print(f"the report is {folder / 'report.md'}, its numbers are in {folder / 'results.json'}")
    return 0


def run_bench(options: argparse.Namespace) -> int:
    """Measure and print."""
    from dataclasses import replace

    from apollonius.bench import CLASSIC, bench_env, bench_train
    from apollonius.learn.config import PROFILES

    if options.what == "env":
        result = bench_env(4096 if options.games is None else options.games)
    else:
        profiles = {"classic": CLASSIC, **PROFILES}
        require(options.profile in profiles, "--profile", options.profile, f"one of {', '.join(profiles)}")
        config = profiles[options.profile]
        result = bench_train(config if options.games is None else replace(config, games=options.games))
    if options.json:
        print(json.dumps(result))
    else:
        for key, value in result.items():
            digits = f",.{0 if value >= 100 else 2}f" if isinstance(value, float) else ""
            print(f"{key:<30} {value:{digits}}")
    return 0


@contextmanager
def _plots() -> Iterator[None]:
    """What is imported here needs matplotlib, and says so where it is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name != "matplotlib":
            raise
        raise InvalidInput("figures need matplotlib: pip install 'apollonius[plot]'.") from error


def _requested_game(options: argparse.Namespace) -> "Game":
    """The named game with the wanted starts."""
    from dataclasses import replace

    from apollonius.game.presets import make_game

    game = make_game(options.game)
    return replace(game, starts=replace(game.starts, speed=options.starts))


def _requested_config(options: argparse.Namespace) -> "RunConfig":
    """The preset or file, with what the command line changes."""
    from dataclasses import replace

    from apollonius.game.presets import make_game
    from apollonius.learn.config import PRESETS, PROFILES
    from apollonius.learn.folder import load_config

    require(options.preset in PRESETS, "--preset", options.preset, f"one of {', '.join(PRESETS)}")
    require(options.profile in (None, *PROFILES), "--profile", options.profile, f"one of {', '.join(PROFILES)}")
    config = load_config(options.config) if options.config else PRESETS[options.preset]
    changes: dict[str, Any] = {
        "stages": options.stage,
        "seed": options.seed,
        "evaders": tuple(options.evader) if options.evader else None,
        "pursuer": options.pursuer,
        "dqn": PROFILES.get(options.profile),
        "game": make_game(options.game) if options.game else None,
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

    before = signal.signal(signal.SIGINT, on_interrupt)
    try:
        with TrainingDisplay() as display:
            finished = Run(config, folder, display, lambda: bool(interrupts)).execute()
    finally:
        signal.signal(signal.SIGINT, before)
    if not finished:
        print(f"stopped; go on with: apollonius resume {folder}", file=sys.stderr)
        return INTERRUPTED
    _judge(config, folder)
    return 0


def _judge(config: "RunConfig", folder: Path, games: int = 2000) -> None:
    """Play the agents of a finished run; print the tables and keep them in `evaluation.json`."""
    from apollonius.agents.catalogue import find_agent
    from apollonius.agents.store import write_atomically
    from apollonius.evaluate.match import play_match
    from apollonius.game.types import Role
    from apollonius.terminal import match_table

    files = sorted((folder / "agents").glob("*.safetensors"))
    agents = {path.stem: str(path) for path in files if "-" not in path.stem}
    evaders = ["random", *[name for name in agents if name.startswith("E_")]]
    record = {}
    for name in [name for name in agents if name.startswith("P_")]:
        for opponent in ["still"] if name == "P_stage1" else evaders:
            pursuer = find_agent(agents[name], Role.PURSUER)
            evader = find_agent(agents.get(opponent, opponent), Role.EVADER)
            result = play_match(config.game, pursuer.policy, evader.policy, games, seed=1)
            record[f"{name} against {opponent}"] = result.to_dict()
            print(match_table(name, opponent, result), end="\n\n")
    write_atomically(folder / "evaluation.json", json.dumps(record, indent=2).encode())
    print(f"agents and metrics are in {folder}{os.sep}")
