"""How much of the gap between the rules and robots with bodies does training with disturbed robots close?

    python -m studies.robust --config examples/robust.toml --out runs/robust --seeds 3

trains the self-play of that file with every seed, one process on every core, then plays the agents it goes on from,
those it came to and strangers against each other, by the rules and with bodies in MuJoCo, and writes `robust.json` and
`robust.md`. Stopped or killed at any point, the same command goes on where it was.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

from apollonius.agents.disturbance import NONE
from apollonius.arenas.record import to_dict
from apollonius.bodies.comparison import Comparison, compare
from apollonius.bodies.drive import Drive
from apollonius.bodies.physics import Physics
from apollonius.bodies.simulation import simulate_match
from apollonius.errors import InvalidInput, exit_status, require
from apollonius.evaluate.kept import facts_of, kept_result, match_file
from apollonius.evaluate.match import Match, play_games
from apollonius.evaluate.round_robin import RoundRobin
from apollonius.game.by_side import BySide
from apollonius.jobs import Job
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import load_config
from apollonius.reproduce.finding import Finding
from studies import driver
from studies.robust_report import find


def kept_comparison(folder: Path, match: Match) -> Comparison:
    """A match by the rules and with bodies, kept and refused as `kept_match` does."""

    def play() -> Comparison:
        return compare(match, play_games(match), simulate_match(match, Drive()))

    path = match_file(folder, match.pursuer.name, match.evader.name)
    return kept_result(path, facts_of(match) | {"drive": to_dict(Drive())}, Comparison, play)


@dataclass(frozen=True, kw_only=True)
class Robust(driver.AbstractStudy):
    """A self-play with disturbed robots and several seeds, and strangers to it."""

    name = "robust"
    config: Path = driver.option(Path("examples/robust.toml"), help="the self-play")
    seeds: int = driver.option(3)
    pursuer: str = driver.option("P_pool", help="a pursuer that training does not know")
    evader: str = driver.option("E_curriculum", help="an evader that training does not know")
    seed: int = driver.option(0, help="seed of the starts")

    @cached_property
    def training(self) -> RunConfig:
        """The self-play.

        Raises:
            InvalidInput: when it begins from nobody, or robots are not disturbed in it, or cannot be simulated.
        """
        require(self.config.is_file(), "--config", self.config, "a .toml file; check the path")
        config = load_config(self.config)
        if None in (config.pursuer, config.evader) or config.self_play.disturbance == NONE:
            raise InvalidInput(
                "--config must be a self-play that goes on from two agents, with [self_play.disturbance]."
            )
        Physics(config.game, Drive())
        return config

    @property
    def runs(self) -> dict[str, Path]:
        """Folders of the runs by the names of their seeds."""
        return {f"seed-{seed}": self.out / f"seed-{seed}" for seed in range(self.seeds)}

    @property
    def others(self) -> BySide[tuple[str, ...]]:
        """Whom training went on from, and a stranger to it."""
        pursuer, evader = self.training.pursuer, self.training.evader
        assert pursuer is not None
        assert evader is not None
        return BySide((pursuer, self.pursuer), (evader, self.evader))

    def trainings(self) -> driver.Trainings:
        """One for each seed."""
        runs = enumerate(self.runs.values())
        return {run: (replace(self.training, seed=seed), tuple(driver.LAST)) for seed, run in runs}

    @property
    def matches(self) -> RoundRobin:
        """Everyone against everyone, but that agents of different seeds do not meet."""
        whom = (self.out / "matches", driver.entrants(self.others, self.runs), self.games, self.seed)
        return RoundRobin(*whom, self.training.game, play=kept_comparison, apart=tuple(self.runs))

    def jobs(self) -> Iterator[Sequence[Job]]:
        """The matches of each pursuer."""
        yield self.matches.jobs()

    def finding(self) -> Finding:
        """Three tables."""
        return find(self.matches.results(), *self.others)


main = partial(driver.main, Robust)

if __name__ == "__main__":
    sys.exit(exit_status(main))
