"""How sure a rate is."""

from collections.abc import Sequence
from math import sqrt

import numpy as np
import scipy  # its parts are loaded where they are used: `scipy.stats` alone takes 0.4 s
from jaxtyping import Bool, Float


def wilson_interval(successes: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval of a rate.

    Args:
        successes: how often it happened.
        trials: how often it could have.
        confidence: coverage of the interval.

    Returns:
        Lower and upper end, in [0, 1].

    Raises:
        ValueError: unless `0 <= successes <= trials` and `trials >= 1`.
    """
    interval = scipy.stats.binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    return float(interval.low), float(interval.high)


def difference_interval(first: float, second: float, trials: int) -> tuple[float, float]:
    """95 % interval of the difference of two rates, `first - second`, each from as many independent trials.

    Newcombe's hybrid score interval (method 10 of Newcombe, "Interval estimation for the difference between
    independent proportions", 1998): built from Wilson's intervals of both. On paired starts, where both rates rise and
    fall together, it is too wide.
    """
    (low_1, high_1), (low_2, high_2) = (wilson_interval(round(rate * trials), trials) for rate in (first, second))
    below = sqrt((first - low_1) ** 2 + (high_2 - second) ** 2)
    above = sqrt((high_1 - first) ** 2 + (second - low_2) ** 2)
    return first - second - below, first - second + above


def paired_difference_interval(
    first: Bool[np.ndarray, " trials"], second: Bool[np.ndarray, " trials"]
) -> tuple[float, float]:
    """95 % interval of the difference of two rates, `first - second`, over pairs of trials that belong together.

    Bonett and Price's adjusted Wald interval ("Adjusted Wald confidence interval for a difference of binomial
    proportions based on paired data", 2012): of the pairs that differ, with one added to either kind.
    """
    trials = len(first) + 2
    more, less = ((int(np.sum(one & ~other)) + 1) / trials for one, other in ((first, second), (second, first)))
    reach = 1.959964 * sqrt((more + less - (more - less) ** 2) / trials)
    return max(more - less - reach, -1.0), min(more - less + reach, 1.0)


def seeds_interval(values: Sequence[float]) -> tuple[float, float]:
    """95 % percentile bootstrap interval of the mean over seeds.

    With few seeds it is too narrow: of three seeds it is at most their range.

    Raises:
        ValueError: for fewer than two values.
    """
    resampled = scipy.stats.bootstrap((np.asarray(values),), np.mean, method="percentile", rng=np.random.default_rng(0))
    return float(resampled.confidence_interval.low), float(resampled.confidence_interval.high)


def mean_band(curves: Float[np.ndarray, "seeds points"]) -> tuple[Float[np.ndarray, " points"], ...]:
    """95 % interval of the mean over seeds at every point of a curve, by Student's t.

    Wide with few seeds, as it should be (of three: 2.5 standard deviations either way), where a bootstrap's would stay
    within their range. It takes seeds to be normally distributed around the mean.

    Returns:
        Lower and upper end.

    Raises:
        ValueError: for fewer than two seeds.
    """
    seeds = len(curves)
    if seeds < 2:
        raise ValueError(f"{seeds} seeds have no spread: give two at least")
    mean = curves.mean(axis=0)
    reach = scipy.stats.t.ppf(0.975, seeds - 1) * curves.std(axis=0, ddof=1) / sqrt(seeds)
    return mean - reach, mean + reach
