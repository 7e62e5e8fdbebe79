"""Do continuous actions make motion smoother, and do their agents win as often? Several seeds against the zoo.

    python -m studies.smooth --out runs/smooth --seeds 3

trains what is missing there by the paper's curriculum, with every seed once by soft actor-critic and once by deep
Q-learning, one process on every core, plays all pursuers against all evaders, the zoo's among them, and writes
`smooth.json`, `smooth.md` and `smooth.png`. Stopped or killed at any point, the same command goes on where it was.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from apollonius.errors import exit_status, require
from apollonius.evaluate.round_robin import RoundRobin
from apollonius.game.types import Role
from apollonius.jobs import STOPPED, run_jobs
from apollonius.learn.config import RunConfig, SelfPlayConfig, StageConfig
from apollonius.learn.folder import agent_file
from apollonius.learn.learner_config import SACConfig
from apollonius.learn.scheme import OpponentConfig
from apollonius.learn.trainings import train_runs
from studies.driver import add_workers, chosen_cores
from studies.smooth_report import CONTINUOUS, KINDS, rows_of, write_results

ZOO = {Role.PURSUER: ("P_curriculum", "P_scratch"), Role.EVADER: ("E_curriculum", "E_scratch", "random")}
"""Whom all of them meet beside each other: the paper's own."""
MATCH_SEED = 1


def run_config(kind: str, seed: int, stage_1: int, self_play: int) -> RunConfig:
    """The curriculum with one kind of action, otherwise alike; `stage_1` and `self_play` are env steps.

    Half of the games of self-play are against earlier versions: without them, two that have slowed down together
    forget what a fast opponent is like.
    """
    opponents = OpponentConfig(scheme="prioritised-hard")
    return RunConfig(
        seed=seed,
        sac=SACConfig() if kind == CONTINUOUS else None,
        fixed_target=StageConfig(env_steps=stage_1, evaluations=12, evaluation_games=500),
        self_play=SelfPlayConfig(env_steps=self_play, evaluations=12, evaluation_games=500, opponents=opponents),
    )


def entrants(runs: Sequence[Path], role: Role) -> dict[str, str]:
    """Who plays one side: a name for each, kind and seed or the zoo's, and the agent or its file."""
    own = {f"{run.parent.name} {run.name}": str(agent_file(run, f"{role.name[0]}_curriculum")) for run in runs}
    return {name: name for name in ZOO[role]} | own


def main(arguments: Sequence[str] | None = None) -> int:
    """Train, play, write the table and the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("runs/smooth"), help="folder of the runs")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--stage-1", type=int, default=6_000_000, help="env steps against an evader that stays")
    parser.add_argument("--self-play", type=int, default=8_000_000, help="env steps of self-play")
    parser.add_argument("--games", type=int, default=10_000, help="games in each match")
    add_workers(parser)
    options = parser.parse_args(arguments)
    require(options.seeds >= 1, "--seeds", options.seeds, "at least 1")
    require(options.games >= 1, "--games", options.games, "at least 1")
    out = options.out.absolute()
    cores = chosen_cores(options.processes, out)
    configs = {
        out / kind / f"seed-{seed}": run_config(kind, seed, options.stage_1, options.self_play)
        for seed in range(options.seeds)
        for kind in KINDS
    }
    wanted = {run: (config, ("P_stage1", "P_curriculum", "E_curriculum")) for run, config in configs.items()}
    if not train_runs(wanted, cores, print, options.on):
        return STOPPED
    pursuers, evaders = (entrants(list(configs), role) for role in Role)
    everyone = RoundRobin(out / "matches", pursuers, evaders, options.games, MATCH_SEED)
    if not run_jobs(everyone.jobs(), cores, print, options.on):
        return STOPPED
    print(write_results(out, rows_of(everyone.tournament()), pursuers, evaders))
    return 0


if __name__ == "__main__":
    sys.exit(exit_status(main))
