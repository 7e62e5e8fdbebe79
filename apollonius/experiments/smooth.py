"""Do continuous actions make motion smoother, and do their agents win as often? Several seeds against the zoo.

    python -m apollonius.experiments.smooth --out runs/smooth --seeds 3

trains what is missing there by the paper's curriculum with soft actor-critic, one process on every core, plays all
pursuers against all evaders, and writes `smooth.json`, `smooth.md` and `smooth.png`. Stopped or killed at any point,
the same command goes on where it was.
"""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from apollonius.agents.catalogue import find_agent
from apollonius.agents.store import write_atomically
from apollonius.errors import require
from apollonius.evaluate.match import play_match
from apollonius.experiments.jobs import ENGINES, STOPPED, Job, ShouldStop, available_cores, run_jobs
from apollonius.experiments.smooth_report import CONTINUOUS, write_results
from apollonius.experiments.training import train_runs
from apollonius.game.presets import make_game
from apollonius.game.types import Role
from apollonius.learn.config import RunConfig, SelfPlayConfig, StageConfig
from apollonius.learn.folder import agent_file
from apollonius.learn.learner_config import SACConfig

DISCRETE = {Role.PURSUER: ("P_curriculum", "P_scratch"), Role.EVADER: ("random", "E_curriculum", "E_scratch")}
"""Whom the continuous agents are compared with, and meet: the paper's own."""
MATCH_SEED = 1


def run_config(seed: int, stage_1: int, self_play: int) -> RunConfig:
    """The curriculum with continuous actions; arguments are the seed and the env steps of both stages."""
    return RunConfig(
        seed=seed,
        sac=SACConfig(),
        fixed_target=StageConfig(env_steps=stage_1, evaluation_games=500),
        self_play=SelfPlayConfig(env_steps=self_play, evaluations=20, evaluation_games=500),
    )


def entrants(runs: Sequence[Path], role: Role) -> dict[str, str]:
    """Who plays one side: a name for each, and the agent or its file."""
    own = {f"{CONTINUOUS} {run.name}": str(agent_file(run, f"{role.name[0]}_curriculum")) for run in runs}
    return {name: name for name in DISCRETE[role]} | own


def matches_file(out: Path, pursuer: str) -> Path:
    """Where the matches of one pursuer are kept."""
    return out / "matches" / f"{pursuer.replace(' ', '-')}.json"


def play_row(path: Path, pursuer: str, evaders: dict[str, str], games: int, should_stop: ShouldStop) -> bool:
    """Write the matches of one pursuer against every evader, all on the same starts. Those written are not repeated."""
    game = make_game("paper")
    chasing = find_agent(pursuer, Role.PURSUER, game).policy
    row = json.loads(path.read_text()) if path.exists() else {}
    path.parent.mkdir(parents=True, exist_ok=True)
    for name, evader in evaders.items():
        if name in row and row[name]["games"] == games:
            continue
        if should_stop():
            return False
        row[name] = play_match(game, chasing, find_agent(evader, Role.EVADER, game).policy, games, MATCH_SEED).to_dict()
        write_atomically(path, json.dumps(row, indent=1).encode())
    return True


def main(arguments: Sequence[str] | None = None) -> int:
    """Train, play, write the table and the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("runs/smooth"), help="folder of the runs")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--stage-1", type=int, default=6_000_000, help="env steps against an evader that stays")
    parser.add_argument("--self-play", type=int, default=30_000_000, help="env steps of self-play")
    parser.add_argument("--games", type=int, default=10_000, help="games in each match")
    parser.add_argument("--processes", type=int, help="jobs at a time (default: one for each core)")
    parser.add_argument("--on", choices=ENGINES, default="local", help="where they run (default: %(default)s)")
    options = parser.parse_args(arguments)
    require(options.seeds >= 1, "--seeds", options.seeds, "at least 1")
    require(options.games >= 1, "--games", options.games, "at least 1")
    cores = available_cores()[: options.processes]
    out = options.out.absolute()
    # Seeds share their compilations; the processes that do the work inherit this.
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(out / ".jax_cache"))
    configs = {
        out / f"seed-{seed}": run_config(seed, options.stage_1, options.self_play) for seed in range(options.seeds)
    }
    wanted = {run: (config, ("P_stage1", "P_curriculum", "E_curriculum")) for run, config in configs.items()}
    if not train_runs(wanted, cores, print, options.on):
        return STOPPED
    pursuers, evaders = (entrants(list(configs), role) for role in Role)
    jobs = [
        Job(f"the matches of {name}", play_row, (matches_file(out, name), agent, evaders, options.games))
        for name, agent in pursuers.items()
    ]
    if not run_jobs(jobs, cores, print, options.on):
        return STOPPED
    rows = {name: json.loads(matches_file(out, name).read_text()) for name in pursuers}
    print(write_results(out, rows, pursuers, evaders))
    return 0


if __name__ == "__main__":
    sys.exit(main())
