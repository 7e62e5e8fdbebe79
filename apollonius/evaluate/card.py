"""The regret card of an agent: how far its play is from what can be had, as the solved two-robot game estimates it."""

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from apollonius.evaluate.match import Match, begin, play_games
from apollonius.evaluate.statistics import mean_interval, wilson_interval
from apollonius.game.by_side import BySide
from apollonius.game.outcome import evader_wins, pursuer_wins
from apollonius.game.types import Outcome
from apollonius.play.playout import Report
from apollonius.solve.players import SaddlePolicy

WORST = 10
"""Games that a card lists."""


@dataclass(frozen=True)
class Card:
    """An agent against the table's player of the other side, beside the solved game.

    Rates are in [0, 1], with Wilson 95 % intervals; payoffs are its side's, discounted by the time they take, with 95 %
    intervals of their mean (Student's t).
    """

    role: str
    games: int
    won: float
    won_interval: tuple[float, float]
    lost: float
    lost_interval: tuple[float, float]
    payoff: float
    payoff_interval: tuple[float, float]
    promised: float
    """Mean of what the table of the agent's side promises."""
    at_most: float
    """Mean of what the other side's table promises that its side concedes at most."""
    gap: float
    """Mean over the starts of what that table promises there, less what the agent got."""
    gap_interval: tuple[float, float]
    worst: list[dict[str, Any]]
    """The games that cost most: number, outcome, seconds, gap."""


def measure_card(
    match: Match, own: SaddlePolicy, other: SaddlePolicy, report: Report = lambda done, total: None
) -> Card:
    """Compare what an agent gets from the other side's table with what its own side's table promises.

    Between the nodes of the grid that promise is no bound: it errs either way.

    Args:
        match: the agent against `other`.
        own: the player by the table of the agent's side; `other` is that by the other side's.

    Raises:
        InvalidInput: as `play_match`.
    """
    zero_sum_game, games = own.zero_sum_game, match.games
    starts, _ = begin(match)
    results = play_games(match, report=report)
    seconds = results.steps.astype(jnp.float32) * match.game.dt
    payoffs = np.asarray(zero_sum_game.payoff_of(results.outcome, seconds))
    promised = np.asarray(own.best_value(starts))
    gaps = promised - payoffs
    counts = BySide(pursuer_wins(results.outcome), evader_wins(results.outcome, time_limit_wins=False))
    won, lost = (int(np.sum(counts[role])) for role in (zero_sum_game.role, zero_sum_game.role.other))
    return Card(
        role=zero_sum_game.role.name.lower(),
        games=games,
        won=won / games,
        won_interval=wilson_interval(won, games),
        lost=lost / games,
        lost_interval=wilson_interval(lost, games),
        payoff=float(np.mean(payoffs)),
        payoff_interval=mean_interval(payoffs, -1.0, 1.0),
        promised=float(np.mean(promised)),
        at_most=-float(np.mean(np.asarray(other.best_value(starts)))),
        gap=float(np.mean(gaps)),
        gap_interval=mean_interval(gaps, -2.0, 2.0),
        worst=[
            {
                "game": index,
                "outcome": Outcome(int(results.outcome[index])).name.lower(),
                "seconds": round(float(seconds[index]), 2),
                "gap": round(float(gaps[index]), 4),
            }
            for index in np.argsort(-gaps, kind="stable")[:WORST].tolist()
        ],
    )
