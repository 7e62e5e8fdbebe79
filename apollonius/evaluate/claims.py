"""A claim of the paper against what was measured: the value, the interval, and the verdict."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from apollonius.evaluate.statistics import mean_interval, rate_interval

STAGE_1 = 0.96
"""Share of games captured against an evader that stays, after 200,000 episodes (section IV, Fig. 4)."""

TABLE_2 = {
    "P_random": {
        "captured": 336, "pursuer_hit_obstacle": 28, "evader_hit_obstacle": 26,
        "pursuer_out_of_range": 17, "evader_out_of_range": 93, "no_result": 0,
    },
    "P_curriculum": {
        "captured": 62, "pursuer_hit_obstacle": 15, "evader_hit_obstacle": 52,
        "pursuer_out_of_range": 19, "evader_out_of_range": 351, "no_result": 1,
    },
}  # fmt: skip
"""Games of 500 against the random evader, by pursuer."""

TABLE_3 = {
    "P_random": {
        "captured": 115, "pursuer_hit_obstacle": 69, "evader_hit_obstacle": 66,
        "pursuer_out_of_range": 13, "evader_out_of_range": 36, "no_result": 201,
    },
    "P_curriculum": {
        "captured": 188, "pursuer_hit_obstacle": 62, "evader_hit_obstacle": 135,
        "pursuer_out_of_range": 22, "evader_out_of_range": 30, "no_result": 63,
    },
}  # fmt: skip
"""Games of 500 against the evader of self-play from scratch, by pursuer."""


def paper_shares(pursuer: str, evader: str) -> dict[str, float]:
    """Return the paper's shares of outcomes for a pairing, in [0, 1]; nothing where it reports none."""
    if (pursuer, evader) == ("P_stage1", "still"):
        return {"captured": STAGE_1}
    counts = {"random": TABLE_2, "E_scratch": TABLE_3}.get(evader, {}).get(pursuer, {})
    return {outcome: count / sum(counts.values()) for outcome, count in counts.items()}


FULL_BUDGET = "paper"
"""The preset that trains for as long as the paper."""
FEWEST_SEEDS = 3
"""Trainings that a verdict takes: games of one say nothing of the next."""


@dataclass(frozen=True)
class Claim:
    """A statement of the paper with a bound that our agents have to reach. Rates are in [0, 1]."""

    name: str
    source: str
    """Where it comes from, as `Table II`."""
    paper: float
    """The paper's value."""
    bound: float
    """What has to be reached."""
    seeds: tuple[float, ...]
    """Measured, seed by seed."""
    interval: tuple[float, float]
    """95 % interval of the mean: over seeds, or of a single one over its games."""

    @property
    def mean(self) -> float:
        """Mean over seeds."""
        return sum(self.seeds) / len(self.seeds)

    def verdict(self, is_full: bool = True) -> str:
        """Return `holds` or `does not hold` where the whole interval says so, else `undecided`.

        `not enough` is said of fewer than three trainings, and of shorter ones than the paper's (`is_full` is False).
        """
        if len(self.seeds) < FEWEST_SEEDS or not is_full:
            return "not enough"
        low, high = self.interval
        if low >= self.bound:
            return "holds"
        return "does not hold" if high < self.bound else "undecided"

    def to_dict(self, is_full: bool = True) -> dict[str, Any]:
        """Return the claim with its mean, interval and verdict, as JSON-like data."""
        return asdict(self) | {"mean": self.mean, "verdict": self.verdict(is_full)}


def rate_claim(name: str, source: str, paper: float, bound: float, counts: Sequence[tuple[int, int]]) -> Claim:
    """Return a claim about how often something happens; `counts` are (times, games) of each seed."""
    return Claim(name, source, paper, bound, tuple(times / games for times, games in counts), rate_interval(counts))


def difference_claim(name: str, source: str, paper: float, bound: float, rates: Sequence[tuple[float, float]]) -> Claim:
    """Return a claim about how much more often one thing happens than another; `rates` are both, of each seed."""
    differences = tuple(first - second for first, second in rates)
    return Claim(name, source, paper, bound, differences, mean_interval(differences, -1.0, 1.0))
