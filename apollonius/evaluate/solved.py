"""Solved games in numbers, and the regret card of an agent."""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from apollonius.evaluate.match import Match, draw_starts, play_games, with_start_speeds
from apollonius.evaluate.statistics import mean_interval, wilson_interval
from apollonius.game.game import Game, sample_starts
from apollonius.game.outcome import evader_wins, pursuer_wins
from apollonius.game.types import BySide, Role, value_for_each
from apollonius.play.playout import Report, no_report
from apollonius.solve.grid import make_grid
from apollonius.solve.motion import motion_of, payoff_of
from apollonius.solve.players import SaddlePolicy
from apollonius.solve.reach import Reach
from apollonius.solve.solving import zero_sum_game_of
from apollonius.solve.store import Solution

STARTS = 20_000
"""Starts over which shares and times are taken."""


def describe_solution(solution: Solution, game: Game) -> dict[str, Any]:
    """Return a solution in numbers by their names: how well it was solved, and its values at the
    game's starts.
    """
    problem = solution.problem
    solving = {
        "grid": "x".join(map(str, problem.counts)),
        "hold [s]": round(problem.hold * float(game.dt), 6),
        "sweeps": solution.sweeps,
        "residual": solution.residual,
    }
    kinds = {"safety": _describe_safety, "reach": _describe_reach, "game": _describe_game}
    return solving | kinds[problem.kind](solution, game, Role[problem.role.upper()])


def _describe_safety(solution: Solution, game: Game, role: Role) -> dict[str, Any]:
    grid = make_grid(game.arena, game.body(role), tuple(solution.problem.counts))
    starts = sample_starts(with_start_speeds(game, "moving"), jax.random.key(0), STARTS)
    robots = value_for_each(starts.robots)[role]
    values = jax.jit(jax.vmap(lambda robot: grid.interpolate(solution.table, robot)))(robots)
    return {"moving starts lost, by the table": float(np.mean(np.asarray(values) < 0))}


def _describe_reach(solution: Solution, game: Game, role: Role) -> dict[str, Any]:
    assert solution.problem.target is not None
    x, y = (jnp.asarray(coordinate, jnp.float32) for coordinate in solution.problem.target)
    grid = make_grid(game.arena, game.pursuer, tuple(solution.problem.counts))
    reach = Reach(game, motion_of(game, role, solution.problem.hold), grid, x, y, solution.table)
    robots = sample_starts(game, jax.random.key(0), STARTS).pursuer
    seconds = np.asarray(jax.jit(jax.vmap(reach.seconds))(robots))
    caught = np.isfinite(seconds)
    return {
        "starts with a capture": float(np.mean(caught)),
        "median time to capture [s]": float(np.median(seconds)),
        "longest [s]": float(np.max(seconds[caught], initial=0.0)),
    }


def _describe_game(solution: Solution, game: Game, role: Role) -> dict[str, Any]:
    """Return the value that the table promises the side at the game's starts, most of which are
    between nodes.
    """
    player = SaddlePolicy(zero_sum_game_of(solution.problem, game), solution.table)
    starts = sample_starts(game, jax.random.key(0), STARTS)
    values = np.asarray(player.best_value(starts))
    return {
        f"promised to the {role.name.lower()}, on average over starts": float(np.mean(values)),
        "at the best start": float(np.max(values)),
        "at the worst": float(np.min(values)),
    }


@dataclass(frozen=True)
class RegretCard:
    """An agent against the table's player of the other side, beside the solved game.

    Rates are in [0, 1], with Wilson 95 % intervals; payoffs are its side's, discounted by the time
    they take, with 95 % intervals of their mean (Student's t).
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


def measure_card(
    match: Match, own: SaddlePolicy, other: SaddlePolicy, report: Report = no_report
) -> RegretCard:
    """Measure an agent's regret: its payoff against the solved game's best opponent beside the
    value of its own table.

    Between the nodes of the grid the value is an estimate, no bound.

    Args:
        match: The agent against `other`.
        own: The player by the table of the agent's side.
        other: The player by the table of the opponent's side.
        report: Called with the games so far and in all.
    """
    zero_sum_game = own.zero_sum_game
    games = match.games
    starts, _ = draw_starts(match)
    results = play_games(match, report=report)
    seconds = results.steps.astype(jnp.float32) * match.game.dt
    payoffs = np.asarray(payoff_of(zero_sum_game.role, results.outcome, seconds))
    values = np.asarray(own.best_value(starts))
    gaps = values - payoffs
    counts = BySide(
        pursuer_wins(results.outcome), evader_wins(results.outcome, time_limit_wins=False)
    )
    wins = int(np.sum(counts[zero_sum_game.role]))
    losses = int(np.sum(counts[zero_sum_game.role.other]))
    return RegretCard(
        role=zero_sum_game.role.name.lower(),
        games=games,
        won=wins / games,
        won_interval=wilson_interval(wins, games),
        lost=losses / games,
        lost_interval=wilson_interval(losses, games),
        payoff=float(np.mean(payoffs)),
        payoff_interval=mean_interval(payoffs, -1.0, 1.0),
        promised=float(np.mean(values)),
        at_most=-float(np.mean(np.asarray(other.best_value(starts)))),
        gap=float(np.mean(gaps)),
        gap_interval=mean_interval(gaps, -2.0, 2.0),
    )
