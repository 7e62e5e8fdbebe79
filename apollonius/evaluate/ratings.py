"""Ratings: how strong each player of a tournament is on one scale, as chess players are rated."""

from dataclasses import dataclass
from math import log, sqrt

import numpy as np
import scipy  # its parts are loaded where they are used
from jaxtyping import Float

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
