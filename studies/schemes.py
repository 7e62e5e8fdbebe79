"""Which scheme of self-play makes agents that lose least? Every scheme, several seeds, the same env steps.

    python -m studies.schemes --out runs/schemes --env-steps 4000000 --seeds 3

trains what is missing there, one process on every core, then judges what is not judged yet, and writes `schemes.json`,
`schemes.md` and `schemes.png`. Stopped or killed at any point, the same command goes on where it was.
"""

import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from apollonius.errors import exit_status
from apollonius.evaluate.round_robin import RoundRobin
from apollonius.evaluate.tournament import Tournament
from apollonius.game.by_side import BySide
from apollonius.game.types import ROLES, Role
from apollonius.jobs import Job
from apollonius.learn.config import RunConfig
from apollonius.learn.learner_config import DQNConfig
from apollonius.learn.opponents.opponent_config import OpponentConfig
from apollonius.learn.opponents.schemes import SCHEMES
from apollonius.learn.stage_config import SelfPlayConfig
from apollonius.observe.opponent_aware import OPPONENT_AWARE
from apollonius.reproduce.finding import Finding
from apollonius.show import style
from apollonius.show.curves import draw_lines
from apollonius.show.markdown import markdown_table, mean_over_seeds
from studies import driver, judgement
from studies.judgement import Effort, Judgement, judge, judge_run, judged

RATING_SEED = 2
"""Of the starts in the tournament of all last agents."""
SHORT = DQNConfig(averaging=1e-3, games=256)
"""The profile `fast` for a stage of a few million env steps: weights are averaged over a thousand updates, and with
half the games, seats can be drawn anew twice as often and still let every game come to its end."""
GENTLE = replace(SHORT, learning_rate=1e-4)
"""The same for agents that are good already, which larger steps would first spoil."""

ZERO_SUM_WITHIN = 3.0
"""Distance [m] of a partial zero-sum reward: a third of the paper's arena."""
VARIANTS: dict[str, dict[str, Any]] = {
    "partial-zero-sum": {"zero_sum_within": ZERO_SUM_WITHIN},
    "opponent-aware": {"evader_observation": OPPONENT_AWARE.name},
    "ad-vat": {"zero_sum_within": ZERO_SUM_WITHIN, "evader_observation": OPPONENT_AWARE.name},
}
"""What a stage has otherwise than `latest`: the evader of AD-VAT (the paper's reference [14]), and its parts alone."""


@dataclass(frozen=True)
class Measured:
    """What was measured of a run.

    Attributes:
        seconds: of its training.
        judgements: of either side's agents, by the percentage of self-play at which each was kept.
        elo: of either side's last agent, and the reach of its 95 % interval.
    """

    seconds: float
    judgements: BySide[dict[int, Judgement]]
    elo: BySide[tuple[float, float]]

    def losses(self, role: Role) -> list[float]:
        """How much a side loses at least, as self-play goes on [%]."""
        return [100 * judgement.most for judgement in self.judgements[role].values()]


Measurements = Mapping[str, Sequence[Measured]]
"""The runs of each scheme, one for each seed."""


def run_config(
    scheme: str, seed: int, env_steps: int, pursuer: str = "P_stage1", evader: str | None = None
) -> RunConfig:
    """Self-play that goes on from a pursuer and, if it is given, from an evader. Both agents are kept six times.

    Args:
        scheme: whom both sides meet, or one of `VARIANTS`.
    """
    variant = VARIANTS.get(scheme, {})
    stage = SelfPlayConfig(
        env_steps=env_steps,
        evader_epsilon=SelfPlayConfig.evader_epsilon if evader is None else SelfPlayConfig.pursuer_epsilon,
        evaluations=6,
        evaluation_games=200,
        snapshots=6,
        opponents=OpponentConfig(scheme="latest" if variant else scheme, versions=8, renewal=262_144),
        **variant,
    )
    dqn = SHORT if evader is None else GENTLE
    return RunConfig(seed=seed, stages="self-play", dqn=dqn, self_play=stage, pursuer=pursuer, evader=evader)


@dataclass(frozen=True, kw_only=True)
class Schemes(driver.AbstractStudy):
    """Runs of self-play, one for each scheme and seed, and how thoroughly they are judged."""

    name = "schemes"
    schemes: Sequence[str] = driver.option(
        SCHEMES, type=str, nargs="+", choices=(*SCHEMES, *VARIANTS), metavar="SCHEME",
        help=f"of {', '.join(SCHEMES)} (default: these), {', '.join(VARIANTS)}",
    )  # fmt: skip
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
        schemes = measure(self.runs, self.effort, self.matches.tournament())
        curves = any(len(run.losses(Role.PURSUER)) > 1 for runs in schemes.values() for run in runs)
        if curves:
            draw(schemes, self.out / "schemes.png", self.env_steps)
        settings = {"env_steps": self.env_steps, **asdict(self.effort), "rating_games": self.rating_games}
        rows = {name: [asdict(run) for run in runs] for name, runs in schemes.items()}
        data, pictures = {"settings": settings, "schemes": rows}, ("schemes.png",) if curves else ()
        return Finding("Schemes of self-play", table(schemes), pictures, data=data)


def measure(runs: Mapping[str, Path], effort: Effort, played: Tournament) -> Measurements:
    """All that was measured, by scheme.

    Args:
        runs: by name, SCHEME/seed-N, folders of runs that were judged.
        played: the tournament of their last agents.
    """
    ratings: dict[str, dict[str, dict[str, float]]] = played.to_dict()["ratings"]
    schemes: dict[str, list[Measured]] = {}
    for name, run in runs.items():
        *_, last_line = (run / "metrics.jsonl").read_text().splitlines()
        judgements = ROLES.map(lambda role, run=run: {at: judge(run, role, at, effort) for at in judged(run, role)})
        rated = BySide(ratings["pursuers"][name], ratings["evaders"][name])
        elo = rated.map(lambda row: (row["elo"], row["high"] - row["elo"]))
        schemes.setdefault(name.split("/")[0], []).append(Measured(json.loads(last_line)["seconds"], judgements, elo))
    return schemes


def table(schemes: Measurements) -> str:
    """A row for each scheme: means over seeds, and how far 95 % intervals reach (Student's t over seeds)."""
    wins = [(Role.PURSUER, name, f"pursuer wins against {name}") for name in judgement.ZOO.evader]
    wins += [(Role.EVADER, name, f"evader unbeaten by {name}") for name in judgement.ZOO.pursuer]
    head = ["scheme", "pursuer loses at least", "evader loses at least", "pursuer's Elo", "evader's Elo"]
    lines: list[list[str]] = []
    for scheme, runs in schemes.items():
        cells = [scheme, *(_share(runs, role, lambda agent: agent.most) for role in Role)]
        cells += [mean_over_seeds([run.elo[role][0] for run in runs], "{:.0f}") for role in Role]
        cells += [_share(runs, role, lambda agent, name=name: 1 - agent.against[name].rate) for role, name, _ in wins]
        lines.append([*cells, mean_over_seeds([run.seconds / 60 for run in runs], "{:.1f}")])
    return markdown_table([*head, *(words for *_, words in wins), "minutes"], lines)


def _share(runs: Sequence[Measured], role: Role, rate: Callable[[Judgement], float]) -> str:
    return mean_over_seeds([100 * rate(run.judgements[role][100]) for run in runs], "{:.1f}") + " %"


def draw(schemes: Measurements, path: Path, env_steps: int) -> None:
    """Both sides' losses against env steps, a line for each scheme: the mean over the seeds that have a curve."""
    with style.picture(path, columns=2, width=5.2, height=3.4) as panels:
        for axes, role in zip(panels, Role, strict=True):
            lines = {}
            for scheme, runs in schemes.items():
                curves = [run for run in runs if len(run.losses(role)) > 1]
                if curves:
                    steps = [env_steps * percent / 100 for percent in curves[0].judgements[role]]
                    lines[scheme] = (steps, np.mean([run.losses(role) for run in curves], axis=0).tolist())
            draw_lines(axes, lines)
            axes.set_title(f"how much the {role.name.lower()} loses at least [% of games]")
            axes.set_xlabel("env steps")
        panels[-1].legend(loc="upper left", bbox_to_anchor=(1.02, 1.0))  # beside the lines, which fill the panel


main = partial(driver.main, Schemes)

if __name__ == "__main__":
    sys.exit(exit_status(main))
