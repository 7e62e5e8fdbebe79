"""Intervals of rates and means."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isinf, sqrt
from statistics import NormalDist

import numpy as np
import scipy  # its parts are loaded where they are used: `scipy.stats` alone takes 0.4 s
from jaxtyping import Bool, Float

Z = NormalDist().inv_cdf(0.975)


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Return Wilson's 95 % score interval of a rate, within [0, 1].

    Raises:
        ValueError: For impossible counts.
    """
    if not 0 <= successes <= trials or trials < 1:
        raise ValueError(f"{successes} successes in {trials} trials")
    rate, z = successes / trials, Z
    middle = rate + z**2 / (2 * trials)
    reach = z * sqrt(rate * (1 - rate) / trials + z**2 / (4 * trials**2))
    low, high = ((middle + side * reach) / (1 + z**2 / trials) for side in (-1, 1))
    return low if successes else 0.0, high if successes < trials else 1.0


def paired_difference_interval(
    first: Bool[np.ndarray, " trials"], second: Bool[np.ndarray, " trials"]
) -> tuple[float, float]:
    """Return the 95 % interval of the difference of two rates, `first - second`, over paired
    trials.

    Bonett and Price's adjusted Wald interval ("Adjusted Wald confidence interval for a difference
    of binomial proportions based on paired data", 2012): of the pairs that differ, with one added
    to either kind.
    """
    trials = len(first) + 2
    more = (int(np.sum(first & ~second)) + 1) / trials
    less = (int(np.sum(second & ~first)) + 1) / trials
    reach = Z * sqrt((more + less - (more - less) ** 2) / trials)
    return max(more - less - reach, -1.0), min(more - less + reach, 1.0)


def mean_interval(
    values: Sequence[float] | Float[np.ndarray, " values"], least: float = -inf, most: float = inf
) -> tuple[float, float]:
    """Return the 95 % interval of a mean over independent seeds, arenas or games by Student's t.

    Values are within `least` and `most`; the interval of a single value is that range.
    """
    if len(values) == 1:
        return least, most
    (low,), (high,) = mean_band(np.asarray(values, float)[:, None])
    return max(float(low), least), min(float(high), most)


@dataclass(frozen=True)
class Prediction:
    """The value of a new training, or of a new pair of trainings, by Student's t.

    `spread`, with `freedom` degrees of freedom, is the standard deviation of a new value's distance
    from the mean, infinite where it is unknown. Values are within `least` and `most`.
    """

    mean: float
    spread: float
    freedom: int
    least: float
    most: float

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % prediction interval."""
        if isinf(self.spread):
            return self.least, self.most
        reach = self.spread * float(scipy.stats.t.ppf(0.975, self.freedom))
        return max(self.mean - reach, self.least), min(self.mean + reach, self.most)

    def chance(self, bound: float) -> float | None:
        """Return the probability that a new value reaches a bound; None where the spread is
        unknown.
        """
        if isinf(self.spread):
            return None
        if self.spread == 0:
            return float(self.mean >= bound)
        return float(scipy.stats.t.sf((bound - self.mean) / self.spread, self.freedom))


def predict(values: Float[np.ndarray, "rows columns"], least: float, most: float) -> Prediction:
    """Predict the value of a new row and a new column by two-way random effects.

    Rows and columns are independent trainings of the two sides, and every pair was measured. A
    single column is an opponent that is not trained. The variances of rows, columns and residuals
    are those of the analysis of variance (Searle, Casella and McCulloch, "Variance Components",
    1992). The degrees of freedom are the fewer of the two sides', on the safe side. A single row
    predicts nothing.
    """
    rows, columns = values.shape
    mean = float(values.mean())
    if rows == 1:
        return Prediction(mean, inf, 0, least, most)
    by_row = values.mean(axis=1)
    by_column = values.mean(axis=0)
    if columns == 1:
        deviation = float(by_row.std(ddof=1)) * sqrt(1 + 1 / rows)
        return Prediction(mean, deviation, rows - 1, least, most)
    residuals = values - by_row[:, None] - by_column[None, :] + mean
    residual = np.sum(residuals**2) / ((rows - 1) * (columns - 1))
    of_rows, of_columns = (
        max(means.var(ddof=1) - residual / group_size, 0.0) * (1 + 1 / len(means))
        for means, group_size in ((by_row, columns), (by_column, rows))
    )
    deviation = sqrt(of_rows + of_columns + residual * (1 + 1 / (rows * columns)))
    return Prediction(mean, deviation, min(rows, columns) - 1, least, most)


def mean_band(
    curves: Float[np.ndarray, "seeds points"],
) -> tuple[Float[np.ndarray, " points"], ...]:
    """Return the lower and the upper end of the 95 % interval of a mean curve over seeds, by
    Student's t.

    The interval assumes normally distributed seeds. It is wide for few seeds, 2.5 standard
    deviations either way for three; a percentile bootstrap would stay within their range and cover
    the mean in only 3 of 4 studies.

    Raises:
        ValueError: For fewer than two seeds.
    """
    seeds = len(curves)
    if seeds < 2:
        raise ValueError(f"{seeds} seeds have no spread: give two at least")
    mean = curves.mean(axis=0)
    reach = scipy.stats.t.ppf(0.975, seeds - 1) * curves.std(axis=0, ddof=1) / sqrt(seeds)
    return mean - reach, mean + reach
