"""The same games by the rules and with bodies: what they came to, and how far one step is from the other."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool

from apollonius.evaluate.match import Match, MatchResult, count
from apollonius.evaluate.statistics import paired_difference_interval
from apollonius.game.outcome import PURSUER_FAILS, PURSUER_WINS
from apollonius.game.types import Outcome
from apollonius.playout import Results
from apollonius.simulate.scene import SIDES
from apollonius.simulate.simulation import Simulated

EVENTS: dict[str, tuple[Outcome, ...]] = {
    "pursuer wins": PURSUER_WINS,
    "captured": (Outcome.CAPTURED,),
    "pursuer fails": (*PURSUER_FAILS, Outcome.BOTH_FAILED),
    "evader fails": (Outcome.EVADER_HIT_OBSTACLE, Outcome.EVADER_OUT_OF_RANGE, Outcome.BOTH_FAILED),
    "no result": (Outcome.NO_RESULT,),
}
"""What is counted in pairs: games that ended in one of these."""


@dataclass(frozen=True)
class Difference:
    """How often something happened, in [0, 1], by the rules and with bodies; and how much more often with bodies."""

    rules: float
    bodies: float
    difference: float
    interval: tuple[float, float]
    """95 % interval of the difference, over pairs of games from the same start."""


@dataclass(frozen=True)
class Error:
    """How far a robot is, after one step of the game, from where the rules would have it: root mean square and 95th
    percentile over all steps.
    """

    rms: float
    p95: float


@dataclass(frozen=True)
class Comparison:
    """A match by the rules and the same match with bodies.

    Attributes:
        rules, bodies: what each came to.
        differences: of the events of `EVENTS`.
        tracking: errors of either side's speed [m/s], heading [rad] and position [m].
    """

    rules: MatchResult
    bodies: MatchResult
    differences: dict[str, Difference]
    tracking: dict[str, dict[str, Error]]

    def to_dict(self) -> dict[str, Any]:
        """The comparison as JSON-like data."""
        return asdict(self)


def compare(match: Match, rules: Results, simulated: Simulated) -> Comparison:
    """What two plays of a match come to: by the rules and with bodies."""
    bodies = simulated.results
    differences = {event: difference(_ended(rules, event), _ended(bodies, event)) for event in EVENTS}
    return Comparison(count(match, rules), count(match, bodies), differences, tracking(simulated))


def difference(rules: Bool[np.ndarray, " games"], bodies: Bool[np.ndarray, " games"]) -> Difference:
    """How much more often something happened with bodies, in games from the same starts."""
    often, more = float(rules.mean()), float(bodies.mean())
    return Difference(often, more, more - often, paired_difference_interval(bodies, rules))


def _ended(results: Results, event: str) -> Bool[np.ndarray, " games"]:
    return np.isin(np.asarray(results.outcome), EVENTS[event])


def tracking(simulated: Simulated) -> dict[str, dict[str, Error]]:
    """How far one step of the bodies is from one step by the rules, in all steps of all games."""
    away = (simulated.after - simulated.ideal).astype(float).reshape(-1, 2, 4)
    heading = np.abs((away[..., 3] + np.pi) % (2 * np.pi) - np.pi)
    errors = {"speed": np.abs(away[..., 2]), "heading": heading, "position": np.hypot(away[..., 0], away[..., 1])}
    return {
        side: {
            what: Error(float(np.sqrt(np.mean(error[:, number] ** 2))), float(np.percentile(error[:, number], 95)))
            for what, error in errors.items()
        }
        for number, side in enumerate(SIDES)
    }
