"""Which scheme of self-play makes agents that lose least? Every scheme, several seeds, the same env steps.

    python -m studies.schemes --out runs/schemes --env-steps 4000000 --seeds 3

trains what is missing there, one process on every core, then judges what is not judged yet, and writes `schemes.json`,
`schemes.md` and `schemes.png`. Stopped or killed at any point, the same command goes on where it was.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import get_args

from apollonius.errors import exit_status
from apollonius.evaluate.round_robin import RoundRobin
from apollonius.jobs import Job
from apollonius.learn.config import RunConfig, SelfPlayConfig
from apollonius.learn.learner_config import DQNConfig
from apollonius.learn.scheme import OpponentConfig, Scheme
from apollonius.reproduce.finding import Finding
from studies import driver, judgement
from studies.judgement import Effort, judge_run
from studies.scheme_report import find

SCHEMES: tuple[Scheme, ...] = get_args(Scheme)
RATING_SEED = 2
"""Of the starts in the tournament of all last agents."""
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


@dataclass(frozen=True, kw_only=True)
class Schemes(driver.AbstractStudy):
    """Runs of self-play, one for each scheme and seed, and how thoroughly they are judged."""

    name = "schemes"
    schemes: Sequence[Scheme] = driver.option(SCHEMES, type=str, nargs="+", choices=SCHEMES, metavar="SCHEME")
    seeds: int = driver.option(3)
    env_steps: int = driver.option(4_000_000, help="length of each training")
    pursuer: str = driver.option("P_stage1", help="whom pursuers go on from (default: %(default)s)")
    evader: str | None = driver.option(None, help="whom evaders go on from (default: none, they begin from scratch)")
    curve_seeds: int = driver.option(1, help="seeds whose earlier agents are judged too")
    response_env_steps: int = driver.option(Effort.response_env_steps)
    games: int = driver.option(Effort.games, help="games that judge a response")
    rating_games: int = driver.option(100, help="games of all last agents' matches")

    @property
    def configs(self) -> dict[str, RunConfig]:
        """The trainings by name, SCHEME/seed-N, which is the run's folder too."""
        return {
            f"{scheme}/seed-{seed}": run_config(scheme, seed, self.env_steps, self.pursuer, self.evader)
            for seed in range(self.seeds)
            for scheme in self.schemes
        }

    @property
    def runs(self) -> dict[str, Path]:
        """Their folders."""
        return {name: self.out / name for name in self.configs}

    @property
    def effort(self) -> Effort:
        """How thoroughly each agent is judged."""
        return Effort(self.response_env_steps, self.games)

    def trainings(self) -> driver.Trainings:
        """One for each scheme and seed."""
        return {self.out / name: (config, tuple(driver.LAST)) for name, config in self.configs.items()}

    def jobs(self) -> Iterator[Sequence[Job]]:
        """A judgement of each run, then the tournament."""
        curves = self.curve_seeds * len(self.schemes)
        yield [
            Job(f"the judgement of '{run}'", judge_run, (run, self.effort, index < curves))
            for index, run in enumerate(self.runs.values())
        ]
        yield self.matches.jobs()

    @property
    def matches(self) -> RoundRobin:
        """The tournament of all runs' last agents and the paper's."""
        entrants = driver.entrants(judgement.ZOO, self.runs)
        return RoundRobin(self.out / "tournament", entrants, self.rating_games, RATING_SEED)

    def finding(self) -> Finding:
        """A table and, if any earlier agents were judged, a figure."""
        return find(self.out, self.runs, self.effort, self.matches.tournament())


main = partial(driver.main, Schemes)

if __name__ == "__main__":
    sys.exit(exit_status(main))
