"""What a tournament says of its players: the equilibrium of the matrix of win rates, and Elo ratings."""

from dataclasses import dataclass
from math import log, sqrt

import numpy as np
import scipy  # its parts are loaded where they are used
from jaxtyping import Float

_TOLERANCE = 1e-10
"""How far the linear programme may be from feasible and optimal; its own default, 1e-7, is the least that one sees."""
_SLACK = 1e-9
"""How much less than the value the broadest mixture may get, so that options which are all the same do not bind it."""
_PLAYED = 1e-8
"""Weight from which on an option has a share in an equilibrium, and not an error of the linear programme."""


@dataclass(frozen=True)
class Equilibrium:
    """Mixtures from which neither side of a matrix game gains by leaving, and what the row side then gets."""

    rows: Float[np.ndarray, " rows"]
    columns: Float[np.ndarray, " columns"]
    value: float


def _best_mixture(payoff: Float[np.ndarray, "own others"]) -> Float[np.ndarray, " own"]:
    """The mixture of rows whose payoff is highest in the column that is worst for it."""
    own, others = payoff.shape
    return _solve([0.0] * own + [-1.0], np.column_stack([-payoff.T, np.ones(others)]), np.zeros(others), free=1)


def _solve(
    cost: list[float], rows: Float[np.ndarray, "others variables"], most: Float[np.ndarray, " others"], free: int = 0
) -> Float[np.ndarray, " own"]:
    """The mixture of least cost with `rows @ variables <= most`; the last `free` variables are no part of it."""
    own = len(cost) - free
    answer = scipy.optimize.linprog(
        c=cost,
        A_ub=rows,
        b_ub=most,
        A_eq=[[1.0] * own + [0.0] * free],
        b_eq=[1.0],
        bounds=[(0, None)] * own + [(None, None)] * free,
        options={"primal_feasibility_tolerance": _TOLERANCE, "dual_feasibility_tolerance": _TOLERANCE},
    )
    mixture = np.maximum(answer.x[:own], 0.0)
    return mixture / mixture.sum()


def equilibrium(payoff: Float[np.ndarray, "rows columns"]) -> Equilibrium:
    """Return the minimax mixtures of highest entropy: of several optimal ones, that which favours nobody without need.

    They are unique, and players who are copies of each other share their weight evenly: the ranking of Balduzzi et al.
    ("Re-evaluating evaluation", 2018) where agents meet tasks (their appendix D).
    """
    value = float(np.min(_best_mixture(payoff) @ payoff))
    rows, columns = _broadest_mixture(payoff, value), _broadest_mixture(-payoff.T, -value)
    return Equilibrium(rows, columns, float(rows @ payoff @ columns))


def _broadest_mixture(payoff: Float[np.ndarray, "own others"], value: float) -> Float[np.ndarray, " own"]:
    """The mixture of highest entropy among those that get the value in every column."""
    own = payoff.shape[0]
    # The optimal mixtures that favour each option most; on average one amid them all, where the entropy is smooth.
    corners = [
        _solve(list(-favoured), -payoff.T, _TOLERANCE - np.full(payoff.shape[1], value)) for favoured in np.eye(own)
    ]
    middle = np.mean(corners, axis=0)
    played = middle > _PLAYED
    gains = payoff[played].T
    answer = scipy.optimize.minimize(
        lambda mixture: np.sum(scipy.special.xlogy(mixture, mixture)),
        middle[played],
        jac=lambda mixture: np.log(np.maximum(mixture, _PLAYED)) + 1,
        bounds=[(0, 1)] * len(middle[played]),
        constraints=[
            {"type": "eq", "fun": lambda mixture: mixture.sum() - 1, "jac": np.ones_like},
            {"type": "ineq", "fun": lambda mixture: gains @ mixture - value + _SLACK, "jac": lambda mixture: gains},
        ],
        method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 1000},
    )
    mixture = np.zeros(own)
    mixture[played] = np.maximum(answer.x, 0.0)
    return mixture / mixture.sum()


SCALE = 400 / log(10)
"""Elo points in a unit of log-odds: 400 points ahead wins ten games of eleven."""
MEAN = 1500.0
"""Mean rating of all players of a tournament; only differences mean anything."""
_PRIOR = 0.5
"""Wins and losses that are added to every match, or a player who wins every game would have no rating (Haldane and
Anscombe's correction of log-odds)."""


@dataclass(frozen=True)
class Ratings:
    """Elo ratings of all players of a tournament, and how sure they are.

    Attributes:
        pursuers, evaders: the ratings.
        pursuer_reach, evader_reach: half the width of each one's 95 % interval, relative to the mean of all.
        misfit: root mean square of what the ratings leave unexplained of the win rates; large where players beat each
            other in a circle, which no rating can tell.
    """

    pursuers: Float[np.ndarray, " pursuers"]
    evaders: Float[np.ndarray, " evaders"]
    pursuer_reach: Float[np.ndarray, " pursuers"]
    evader_reach: Float[np.ndarray, " evaders"]
    misfit: float


def rate(wins: Float[np.ndarray, "pursuers evaders"], games: int) -> Ratings:
    """The most likely ratings where pursuer i beats evader j with the odds exp((r_i - s_j) / SCALE).

    The model of Bradley and Terry, "Rank analysis of incomplete block designs" (1952), of two sides that never meet
    their own; the evader wins what the pursuer does not. Intervals are Wald's, from the curvature of the likelihood: of
    the games' chance alone, as if players did not beat each other in circles.

    Args:
        wins: of the pursuer in each match.
        games: in each match.
    """
    pursuers, evaders = wins.shape
    trials = games + 2 * _PRIOR
    design = np.concatenate(
        [np.repeat(np.eye(pursuers), evaders, axis=0), -np.tile(np.eye(evaders), (pursuers, 1))], axis=1
    )
    share = (wins.ravel() + _PRIOR) / trials

    def surprise(strength: Float[np.ndarray, " players"]) -> tuple[float, Float[np.ndarray, " players"]]:
        """Minus the log-likelihood, a convex function, and its gradient."""
        ahead = design @ strength
        likelihood = share * scipy.special.log_expit(ahead) + (1 - share) * scipy.special.log_expit(-ahead)
        return -trials * np.sum(likelihood), trials * design.T @ (scipy.special.expit(ahead) - share)

    strength = scipy.optimize.minimize(surprise, np.zeros(pursuers + evaders), jac=True, method="BFGS").x
    expected = scipy.special.expit(design @ strength)
    curvature = trials * design.T @ (design * (expected * (1 - expected))[:, None])
    # The pseudo-inverse leaves out the one direction that means nothing, all players stronger together.
    reach = scipy.stats.norm.ppf(0.975) * np.sqrt(np.diag(scipy.linalg.pinvh(curvature)))
    rating, reach = MEAN + SCALE * (strength - strength.mean()), SCALE * reach
    misfit = sqrt(np.mean((wins.ravel() / games - expected) ** 2))
    return Ratings(rating[:pursuers], rating[pursuers:], reach[:pursuers], reach[pursuers:], misfit)
