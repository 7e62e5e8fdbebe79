"""The regret card of an agent: how far its play is from what can be had, as the solved two-robot game estimates it."""

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np

from apollonius.evaluate.match import Match, begin, play_games
from apollonius.evaluate.statistics import mean_interval, wilson_interval
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.outcome import evader_wins, pursuer_wins
from apollonius.game.types import GameState, Outcome
from apollonius.io.errors import require
from apollonius.play.playout import Report, Results
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
    """The games that cost most: number, outcome, seconds, gap, start (x, y, v, heading)."""


def measure_card(match: Match, own: SaddlePolicy, report: Report = lambda done, total: None) -> Card:
    """Compare what an agent gets from the other side's table with what its own side's table promises.

    Between the nodes of the grid that promise is no bound: it errs either way.

    Args:
        match: the agent against the player by the other side's table.
        own: the player by the table of the agent's side.

    Raises:
        InvalidInput: as `play_match`, and unless the tables are of two sides.
    """
    zero_sum_game = own.zero_sum_game
    role, other = zero_sum_game.role, match.players[zero_sum_game.role.other].policy
    two = isinstance(other, SaddlePolicy) and other.zero_sum_game.role != role
    require(two, "tables", "of one side", "one of the pursuer and one of the evader")
    assert isinstance(other, SaddlePolicy)
    starts, _ = begin(match)
    results = play_games(match, report=report)
    seconds = results.steps.astype(jnp.float32) * zero_sum_game.game.dt
    payoffs = np.asarray(zero_sum_game.payoff_of(results.outcome, seconds))
    promised = np.asarray(own.best_value(starts))
    gaps = promised - payoffs
    counts = BySide(pursuer_wins(results.outcome), evader_wins(results.outcome, time_limit_wins=False))
    won, lost = int(np.sum(counts[role])), int(np.sum(counts[role.other]))
    return Card(
        role=role.name.lower(),
        games=match.games,
        won=won / match.games,
        won_interval=wilson_interval(won, match.games),
        lost=lost / match.games,
        lost_interval=wilson_interval(lost, match.games),
        payoff=float(np.mean(payoffs)),
        payoff_interval=mean_interval(payoffs, -1.0, 1.0),
        promised=float(np.mean(promised)),
        at_most=-float(jnp.mean(other.best_value(starts))),
        gap=float(np.mean(gaps)),
        gap_interval=mean_interval(gaps, -2.0, 2.0),
        worst=_worst(match.game, starts, results, gaps),
    )


def _worst(game: Game, starts: GameState, results: Results, gaps: np.ndarray) -> list[dict[str, Any]]:
    robots = {"pursuer": starts.pursuer, "evader": starts.evader}
    return [
        {
            "game": int(index),
            "outcome": Outcome(int(results.outcome[index])).name.lower(),
            "seconds": round(int(results.steps[index]) * float(game.dt), 2),
            "gap": round(float(gaps[index]), 4),
        }
        | {
            side: [round(float(leaf[index]), 3) for leaf in (robot.x, robot.y, robot.v, robot.heading)]
            for side, robot in robots.items()
        }
        for index in np.argsort(-gaps, kind="stable")[:WORST]
    ]
