"""The regret card of an agent: how far its play is from what can be had, as the solved two-robot game estimates it."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.agents.kind import Named
from apollonius.evaluate.match import Match, begin, play_games
from apollonius.evaluate.statistics import mean_interval, wilson_interval
from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.outcome import evader_wins, pursuer_wins
from apollonius.game.types import GameState, Outcome, Role
from apollonius.io.errors import require
from apollonius.play.playout import Results
from apollonius.solve.players import AbstractLookahead, SaddlePolicy

WORST = 10
"""Games that a card lists."""


@dataclass(frozen=True)
class Score:
    """What one player got from one opponent. Rates are in [0, 1], with Wilson 95 % intervals."""

    games: int
    won: float
    won_interval: tuple[float, float]
    lost: float
    lost_interval: tuple[float, float]
    payoff: float
    """Mean of what the games were worth."""
    payoff_interval: tuple[float, float]
    """95 % interval of that mean (Student's t)."""


@dataclass(frozen=True)
class Card:
    """An agent beside the solved game. Payoffs are its side's, discounted by the time they take."""

    role: str
    games: int
    sure: float
    """Mean of the table's estimate of what the agent's side can be sure of."""
    at_most: float
    """Mean of the estimate, by the other side's table, of what that side concedes at most."""
    agent: Score
    """The agent, against the table's player of the other side."""
    gap: float
    """Mean over the starts of the estimate of what its side can be sure of there, less what the agent got."""
    gap_interval: tuple[float, float]
    response: Score | None
    """The agent against an opponent that looks ahead knowing what the agent does; None if it was not asked for."""
    worst: list[dict[str, Any]]
    """The games against the table's player that cost most: number, outcome, seconds, gap, start (x, y, v, heading)."""

    def to_dict(self) -> dict[str, Any]:
        """The card as JSON-like data."""
        return asdict(self)


def measure_card(
    match: Match,
    own: SaddlePolicy,
    response: AbstractLookahead | None = None,
    response_games: int = 1000,
    report: Callable[[str, int, int], None] = lambda opponent, done, total: None,
) -> Card:
    """Compare what an agent gets from the other side's table with an estimate of what its own side can be sure of.

    The estimate is the table's of the agent's side. Between the nodes of the grid it is no bound: it errs either way.

    Args:
        match: the agent against the player by the other side's table.
        own: the player by the table of the agent's side.
        response: an opponent that knows the agent; it plays the first `response_games` starts of another match.
        report: told against whom it plays, table or response, how many of these games have ended, and how many there
            are.

    Raises:
        InvalidInput: as `play_match`, and unless the tables are of two sides and one payoff.
    """
    role, game = own.zero_sum_game.role, match.game
    other = match.players[role.other].policy
    two = isinstance(other, SaddlePolicy) and other.zero_sum_game.role != role
    require(two, "tables", "of one side", "one of the pursuer and one of the evader")
    assert isinstance(other, SaddlePolicy)
    same = (own.zero_sum_game.win, own.zero_sum_game.lose) == (-other.zero_sum_game.lose, -other.zero_sum_game.win)
    require(same, "tables", "of two payoffs", "two that were solved with the same payoff")
    starts, _ = begin(match)
    results = play_games(match, report=partial(report, "table"))
    payoffs, sure = _payoffs(own, results), np.asarray(own.best_value(starts))
    gaps = sure - payoffs
    answered = None
    if response is not None:
        both = BySide.of(role, match.players[role], Named("response", response))
        answer = replace(match, players=both, games=response_games)
        lost_to = play_games(answer, report=partial(report, "response"))
        answered = _score(role, lost_to, _payoffs(own, lost_to))
    return Card(
        role=role.name.lower(),
        games=match.games,
        sure=float(np.mean(sure)),
        at_most=-float(jnp.mean(other.best_value(starts))),
        agent=_score(role, results, payoffs),
        gap=float(np.mean(gaps)),
        gap_interval=mean_interval(gaps, -2.0, 2.0),
        response=answered,
        worst=_worst(game, starts, results, gaps),
    )


def _payoffs(own: SaddlePolicy, results: Results) -> np.ndarray:
    seconds = results.steps.astype(jnp.float32) * own.zero_sum_game.game.dt
    return np.asarray(jax.vmap(own.zero_sum_game.payoff_of)(results.outcome, seconds))


def _score(role: Role, results: Results, payoffs: np.ndarray) -> Score:
    won, lost = (
        int(np.sum(which))
        for which in (pursuer_wins(results.outcome), evader_wins(results.outcome, time_limit_wins=False))
    )
    if role == Role.EVADER:
        won, lost = lost, won
    games = len(payoffs)
    return Score(
        games,
        won / games, wilson_interval(won, games), lost / games, wilson_interval(lost, games),
        float(np.mean(payoffs)), mean_interval(payoffs, -1.0, 1.0),
    )  # fmt: skip


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
