"""How much of the gap between the rules and robots with bodies does training with disturbed robots close?

    python -m studies.robust --config examples/robust.toml --out runs/robust --seeds 3

trains the self-play of that file with every seed, one process on every core, then plays the agents it goes on from,
those it came to and strangers against each other, by the rules and with bodies in MuJoCo, and writes `robust.json` and
`robust.md`. Stopped or killed at any point, the same command goes on where it was.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from apollonius.agents.disturbance import NONE
from apollonius.arenas.record import to_dict
from apollonius.errors import InvalidInput, exit_status, require
from apollonius.evaluate.match import Match, MatchResult, play_games
from apollonius.evaluate.match_cache import cached_result, facts_of, match_file
from apollonius.evaluate.round_robin import RoundRobin
from apollonius.game.by_side import BySide
from apollonius.game.types import Role
from apollonius.jobs import Job
from apollonius.learn.config import RunConfig
from apollonius.learn.folder import load_config
from apollonius.reproduce.finding import Finding, Shares, outcome_shares, outcome_table
from apollonius.show.markdown import markdown_table, mean_over_seeds
from apollonius.simulate.comparison import Comparison, compare
from apollonius.simulate.drive import Drive
from apollonius.simulate.physics import Physics
from apollonius.simulate.scene import SIDES
from apollonius.simulate.simulation import simulate_match
from studies import driver

Comparisons = Mapping[tuple[str, str], Comparison]
"""By the names of pursuer and evader: their match by the rules and with bodies."""
ROBUST = "robust"
"""What the agents of all seeds are called together."""


def kept_comparison(folder: Path, match: Match) -> Comparison:
    """A match by the rules and with bodies, kept and refused as `cached_match` does."""

    def play() -> Comparison:
        return compare(match, play_games(match), simulate_match(match, Drive()))

    path = match_file(folder, match.players.pursuer.name, match.players.evader.name)
    return cached_result(path, facts_of(match) | {"drive": to_dict(Drive())}, Comparison, play)


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
        found, others = self.matches.results(), tuple(self.others)
        text = "\n\n".join(tell(found, *others) for tell in (gap_table, outcomes, tracking))
        return Finding("Training with disturbed robots", text, data=driver.as_data(found))


def gap_table(found: Comparisons, pursuers: Sequence[str], evaders: Sequence[str]) -> str:
    """A row for each side and opponent: in how many games the agent that training went on from fails, in how many those
    of the seeds do, and how much of what bodies add to the former the latter are without.

    Where the opponent is of a seed, each seed's agent meets its own, and what they are compared with is the match of
    the two that training went on from.
    """
    head = ["of", "against", "fails by the rules [%]", "with bodies [%]"]
    head += ["trained so, by the rules [%]", "with bodies [%]", "of the gap closed [%]"]
    lines: list[list[str]] = []
    for role, base, others in ((Role.PURSUER, pursuers[0], evaders), (Role.EVADER, evaders[0], pursuers)):
        for opponent in (*others, ROBUST):
            own = opponent == ROBUST
            first = _failures(found, role, base, others[0] if own else opponent)
            trained = [_failures(found, role, seed, seed if own else opponent) for seed in seeds_of(found)]
            gap = first["bodies"] - first["rules"]
            closed = [100 * (first["bodies"] - rates["bodies"]) / gap for rates in trained if gap > 0]
            lines.append([
                role.name.lower(), opponent, f"{first['rules']:.1f}", f"{first['bodies']:.1f}",
                *(mean_over_seeds([rates[kind] for rates in trained], "{:.1f}") for kind in ("rules", "bodies")),
                mean_over_seeds(closed, "{:.0f}"),
            ])  # fmt: skip
    return markdown_table(head, lines)


def _failures(found: Comparisons, role: Role, own: str, opponent: str) -> dict[str, float]:
    """In how many of its games an agent fails, by the rules and with bodies [%]."""
    match = found[BySide.of(role, own, opponent).pair]
    rates = match.differences[f"{role.name.lower()} fails"]
    return {"rules": 100 * rates.rules, "bodies": 100 * rates.bodies}


def outcomes(found: Comparisons, pursuers: Sequence[str], evaders: Sequence[str]) -> str:
    """How the games of both agents that training went on from end, those of the seeds and those of two strangers; and
    how often the pursuer wins.
    """
    columns: list[tuple[str, Shares]] = []
    for name, matches in _pairings(found, pursuers, evaders).items():
        columns.append((f"{name}, by the rules", _shares([match.rules for match in matches])))
        columns.append((f"{name}, with bodies", _shares([match.bodies for match in matches])))
    return outcome_table(columns)


def tracking(found: Comparisons, pursuers: Sequence[str], evaders: Sequence[str]) -> str:
    """How far a step of the bodies is from one by the rules: root mean squares, in the mean over seeds."""
    lines = []
    for name, matches in _pairings(found, pursuers, evaders).items():
        for side in SIDES:
            errors = [match.tracking[side] for match in matches]
            rms = {what: float(np.mean([error[what].rms for error in errors])) for what in errors[0]}
            lines.append([name, side, f"{rms['speed']:.3f}", f"{rms['heading']:.3f}", f"{1000 * rms['position']:.1f}"])
    return markdown_table(["match", "of", "speed [m/s]", "heading [rad]", "position [mm]"], lines)


def seeds_of(found: Comparisons) -> list[str]:
    """Names of the seeds' agents: the only ones that meet one of their own name."""
    return [pursuer for pursuer, evader in found if pursuer == evader]


def _pairings(found: Comparisons, pursuers: Sequence[str], evaders: Sequence[str]) -> dict[str, list[Comparison]]:
    """The matches of the two agents that training went on from, and of the seeds', by what they are called."""
    seeds = seeds_of(found)
    return {
        f"{pursuers[0]} and {evaders[0]}": [found[(pursuers[0], evaders[0])]],
        f"{ROBUST} and {evaders[0]}": [found[(seed, evaders[0])] for seed in seeds],
        f"{pursuers[0]} and {ROBUST}": [found[(pursuers[0], seed)] for seed in seeds],
        f"{ROBUST} and {ROBUST}": [found[(seed, seed)] for seed in seeds],
        f"{pursuers[1]} and {evaders[1]}": [found[(pursuers[1], evaders[1])]],
    }


def _shares(results: Sequence[MatchResult]) -> Shares:
    """Share of each outcome and of the pursuer's wins."""
    return outcome_shares(results) | {"pursuer_wins": [result.pursuer_win_rate for result in results]}


main = partial(driver.main, Robust)

if __name__ == "__main__":
    sys.exit(exit_status(main))
