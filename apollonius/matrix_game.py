"""Matrix games: one side picks a row to raise the payoff, the other a column to lower it, both at once."""

from dataclasses import dataclass
from math import log, sqrt

import numpy as np
from jaxtyping import Float
from scipy.optimize import linprog

_TOLERANCE = 1e-10
"""How far the linear programme may be from feasible and optimal; its own default, 1e-7, is the least that one sees."""


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
    answer = linprog(
        c=[0.0] * own + [-1.0],
        A_ub=np.column_stack([-payoff.T, np.ones(others)]),
        b_ub=np.zeros(others),
        A_eq=[[1.0] * own + [0.0]],
        b_eq=[1.0],
        bounds=[(0, None)] * own + [(None, None)],
        options={"primal_feasibility_tolerance": _TOLERANCE, "dual_feasibility_tolerance": _TOLERANCE},
    )
    mixture = np.maximum(answer.x[:-1], 0.0)
    return mixture / mixture.sum()


def hedge(payoff: Float[np.ndarray, "rows columns"], rounds: int = 1000) -> Equilibrium:
    """The mixtures that both sides play on average when either learns by Hedge against the other.

    In each round a side plays every option with a weight that has grown by exp(step * payoff) with each round before
    (Freund and Schapire, "Adaptive game playing using multiplicative weights", 1999). With the step sqrt(8 ln n / T) of
    n options in T rounds both together gain at most sqrt(ln n / 2T) + sqrt(ln m / 2T) by leaving, for payoffs within a
    range of 1. Unlike the minimax mixture, it leaves some weight on all but the worst.
    """
    steps = [sqrt(8 * log(max(2, options)) / rounds) for options in payoff.shape]
    gains = [np.zeros(options) for options in payoff.shape]
    sums = [np.zeros(options) for options in payoff.shape]
    for _ in range(rounds):
        rows, columns = (_softmax(step * gain) for step, gain in zip(steps, gains, strict=True))
        sums[0] += rows
        sums[1] += columns
        gains[0] += payoff @ columns
        gains[1] -= rows @ payoff
    rows, columns = (total / total.sum() for total in sums)
    return Equilibrium(rows, columns, float(rows @ payoff @ columns))


def _softmax(logits: Float[np.ndarray, " options"]) -> Float[np.ndarray, " options"]:
    weights = np.exp(logits - logits.max())
    return weights / weights.sum()


def gain_by_leaving(payoff: Float[np.ndarray, "rows columns"], mixed: Equilibrium) -> float:
    """What both sides together could gain by answering the other's mixture with their best option: 0 in equilibrium."""
    return float(np.max(payoff @ mixed.columns) - np.min(mixed.rows @ payoff))
