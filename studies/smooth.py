"""Do continuous actions make motion smoother, and do their agents win as often? Several seeds against the zoo.

    python -m studies.smooth --out runs/smooth --seeds 3

trains what is missing there by the paper's curriculum, with every seed once by soft actor-critic and once by deep
Q-learning, one process on every core, plays all pursuers against all evaders, the zoo's among them, and writes
`smooth.json`, `smooth.md` and `smooth.png`. Stopped or killed at any point, the same command goes on where it was.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from apollonius.errors import exit_status
from apollonius.evaluate.round_robin import RoundRobin
from apollonius.game.by_side import BySide
from apollonius.jobs import Job
from apollonius.learn.config import RunConfig, SelfPlayConfig, StageConfig
from apollonius.learn.learner_config import SACConfig
from apollonius.learn.scheme import OpponentConfig
from apollonius.reproduce.finding import Finding
from studies import driver
from studies.smooth_report import CONTINUOUS, KINDS, find

ZOO = BySide(("P_curriculum", "P_scratch"), ("E_curriculum", "E_scratch", "random"))
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


@dataclass(frozen=True, kw_only=True)
class Smooth(driver.AbstractStudy):
    """Both kinds of action with several seeds."""

    name = "smooth"
    seeds: int = driver.option(3)
    stage_1: int = driver.option(6_000_000, help="env steps against an evader that stays")
    self_play: int = driver.option(8_000_000, help="env steps of self-play")
    games: int = driver.option(10_000, help="games in each match")

    def trainings(self) -> driver.Trainings:
        """Of each seed, one for each kind."""
        return {
            self.out / kind / f"seed-{seed}": (
                run_config(kind, seed, self.stage_1, self.self_play),
                ("P_stage1", *driver.LAST),
            )
            for seed in range(self.seeds)
            for kind in KINDS
        }

    @property
    def matches(self) -> RoundRobin:
        """All of them and the zoo; who was trained here is called by kind and seed."""
        runs = {f"{run.parent.name} {run.name}": run for run in self.trainings()}
        return RoundRobin(self.out / "matches", driver.entrants(ZOO, runs), self.games, MATCH_SEED)

    def jobs(self) -> Iterator[Sequence[Job]]:
        """The matches of each pursuer."""
        yield self.matches.jobs()

    def finding(self) -> Finding:
        """Two tables, and both motions."""
        return find(self.out, self.matches)


main = partial(driver.main, Smooth)

if __name__ == "__main__":
    sys.exit(exit_status(main))
