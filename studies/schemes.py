"""Which scheme of self-play makes agents that lose least? Every scheme, several seeds, the same env steps.

    python -m studies.schemes --out runs/schemes --env-steps 4000000 --seeds 3

trains what is missing there, one process on every core, then judges what is not judged yet, and writes `schemes.json`,
`schemes.md` and `schemes.png`. Stopped or killed at any point, the same command goes on where it was.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import get_args

from apollonius.errors import exit_status, require
from apollonius.jobs import STOPPED, Job, run_jobs
from apollonius.learn.config import RunConfig, SelfPlayConfig
from apollonius.learn.learner_config import DQNConfig
from apollonius.learn.scheme import OpponentConfig, Scheme
from apollonius.learn.trainings import train_runs
from studies.driver import add_workers, chosen_cores
from studies.scheme_measures import Effort, everyone, judge_run
from studies.scheme_report import write_results

SCHEMES: tuple[Scheme, ...] = get_args(Scheme)
SHORT = DQNConfig(averaging=1e-3, games=256)
"""The profile `fast` for a stage of a few million env steps: weights are averaged over a thousand updates, and with
half the games, seats can be drawn anew twice as often and still let every game come to its end."""
GENTLE = replace(SHORT, learning_rate=1e-4)
"""The same for agents that are good already, which larger steps would first spoil."""


def run_config(
    scheme: Scheme, seed: int, env_steps: int, pursuer: str = "P_stage1", evader: str | None = None
) -> RunConfig:
    """Self-play that goes on from a pursuer and, if it is given, from an evader. Both agents are kept six times."""
    stage = SelfPlayConfig(
        env_steps=env_steps,
        evader_epsilon=SelfPlayConfig.evader_epsilon if evader is None else SelfPlayConfig.pursuer_epsilon,
        evaluations=6,
        evaluation_games=200,
        snapshots=6,
        opponents=OpponentConfig(scheme=scheme, versions=8, renewal=262_144),
    )
    dqn = SHORT if evader is None else GENTLE
    return RunConfig(seed=seed, stages="self-play", dqn=dqn, self_play=stage, pursuer=pursuer, evader=evader)


def judge_all(out: Path, runs: Sequence[Path], curve_runs: int, effort: Effort, cores: Sequence[int], on: str) -> bool:
    """Judge what is not judged yet: every run, of the first `curve_runs` earlier agents too, then the tournament.
    Returns False if it was stopped.
    """
    jobs = [
        Job(f"the judgement of '{run}'", judge_run, (run, effort, index < curve_runs)) for index, run in enumerate(runs)
    ]
    return run_jobs(jobs, cores, print, on) and run_jobs(everyone(out, runs, effort).jobs(), cores, print, on)


def main(arguments: Sequence[str] | None = None) -> int:
    """Train, judge, write the table and the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("runs/schemes"), help="folder of the runs")
    parser.add_argument("--schemes", nargs="+", choices=SCHEMES, default=SCHEMES, metavar="SCHEME")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--env-steps", type=int, default=4_000_000, help="length of each training")
    parser.add_argument("--pursuer", default="P_stage1", help="whom pursuers go on from (default: %(default)s)")
    parser.add_argument("--evader", help="whom evaders go on from (default: none, they begin from scratch)")
    parser.add_argument("--curve-seeds", type=int, default=1, help="seeds whose earlier agents are judged too")
    parser.add_argument("--response-env-steps", type=int, default=Effort.response_env_steps)
    parser.add_argument("--games", type=int, default=Effort.games, help="games that judge a response")
    parser.add_argument(
        "--rating-games", type=int, default=Effort.rating_games, help="games of all last agents' matches"
    )
    add_workers(parser)
    parser.add_argument("--only", choices=("train", "judge"), help="stop after training, or train nothing")
    options = parser.parse_args(arguments)
    require(options.seeds >= 1, "--seeds", options.seeds, "at least 1")
    effort = Effort(options.response_env_steps, options.games, options.rating_games)
    out = options.out.absolute()
    cores = chosen_cores(options.processes, out)
    configs = {
        out / scheme / f"seed-{seed}": run_config(scheme, seed, options.env_steps, options.pursuer, options.evader)
        for seed in range(options.seeds)
        for scheme in options.schemes
    }
    runs = list(configs)
    if options.only != "judge":
        wanted = {run: (config, ("P_curriculum", "E_curriculum")) for run, config in configs.items()}
        if not train_runs(wanted, cores, print, options.on):
            return STOPPED
    if options.only == "train":
        return 0
    if not judge_all(out, runs, options.curve_seeds * len(options.schemes), effort, cores, options.on):
        return STOPPED
    print(write_results(out, runs, effort))
    return 0


if __name__ == "__main__":
    sys.exit(exit_status(main))
