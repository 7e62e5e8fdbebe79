"""A claim of the paper against what was measured: the value, the interval, and the verdict."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from apollonius.evaluate.statistics import Prediction, predict

STAGE_1 = 0.96
"""Share of games captured against an evader that stays, after 200,000 episodes (section IV, Fig.
4).
"""

_COUNTED = (
    "captured",
    "pursuer_hit_obstacle",
    "evader_hit_obstacle",
    "pursuer_out_of_range",
    "evader_out_of_range",
    "no_result",
)


def _read_counts(*games: int) -> dict[str, int]:
    return dict(zip(_COUNTED, games, strict=True))


TABLE_2 = {
    "P_random": _read_counts(336, 28, 26, 17, 93, 0),
    "P_curriculum": _read_counts(62, 15, 52, 19, 351, 1),
}
"""Games of 500 against the random evader, by pursuer."""
TABLE_3 = {
    "P_random": _read_counts(115, 69, 66, 13, 36, 201),
    "P_curriculum": _read_counts(188, 62, 135, 22, 30, 63),
}
"""Games of 500 against the evader of self-play from scratch, by pursuer."""


def paper_shares(pursuer: str, evader: str) -> dict[str, float]:
    """Return the paper's shares of outcomes for a pairing, in [0, 1]; nothing where it reports
    none.
    """
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
    """A statement of the paper, its value there, and a bound that our agents have to reach.

    Values, from `least` to 1, are a row for each training of the pursuer and a column for each of
    the evader where it is trained.
    """

    name: str
    source: str
    paper: float
    bound: float
    values: tuple[tuple[float, ...], ...]
    least: float = 0.0

    @property
    def prediction(self) -> Prediction:
        """The value that another pair of trainings would show."""
        return predict(np.array(self.values), self.least, 1.0)

    def verdict(self, is_full: bool = True) -> str:
        """Return `holds` or `does not hold` where the whole prediction interval says so, else
        `undecided`.

        `not enough` is said of fewer than three trainings, and of shorter ones than the paper's
        (`is_full` is False).
        """
        if len(self.values) < FEWEST_SEEDS or not is_full:
            return "not enough"
        low, high = self.prediction.interval
        if low >= self.bound:
            return "holds"
        return "does not hold" if high < self.bound else "undecided"

    def to_dict(self, is_full: bool = True) -> dict[str, Any]:
        """Return the claim with its mean, prediction, chance to reach the bound and verdict, as
        JSON-like data.
        """
        prediction = self.prediction
        derived = {
            "mean": prediction.mean,
            "interval": prediction.interval,
            "chance": prediction.chance(self.bound),
        }
        return asdict(self) | derived | {"verdict": self.verdict(is_full)}
