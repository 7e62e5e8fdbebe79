"""Matrix games: one side picks a row to raise the payoff, the other a column to lower it, both at once."""

from dataclasses import dataclass

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


def equilibrium(payoff: Float[np.ndarray, "rows columns"]) -> Equilibrium:
    """The minimax mixtures of a matrix game.

    As a ranking of players it does not care how often a weak one, or a copy of one, takes part (Balduzzi et al.,
    "Re-evaluating evaluation", 2018). It is the linear programme of von Neumann; where several mixtures are optimal, it
    is one of them.
    """
    rows, columns = _best_mixture(payoff), _best_mixture(-payoff.T)
    return Equilibrium(rows, columns, float(rows @ payoff @ columns))


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


def broadest_equilibrium(payoff: Float[np.ndarray, "rows columns"]) -> Equilibrium:
    """The minimax mixtures of highest entropy: where several are optimal, the one that favours nobody without need.

    It is unique, and players who are copies of each other share their weight evenly: what Balduzzi et al.
    ("Re-evaluating evaluation", 2018) rank players by, where agents meet tasks (their appendix D).
    """
    value = equilibrium(payoff).value
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
