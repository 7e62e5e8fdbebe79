"""How sure a rate is."""

from collections.abc import Sequence
from math import inf, sqrt
from statistics import NormalDist

import numpy as np
import scipy  # its parts are loaded where they are used: `scipy.stats` alone takes 0.4 s
from jaxtyping import Bool, Float

Z = NormalDist().inv_cdf(0.975)


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Return Wilson's 95 % score interval of a rate, within [0, 1]; raises ValueError for counts that cannot be."""
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
    """Return the 95 % interval of the difference of two rates, `first - second`, over paired trials.

    Bonett and Price's adjusted Wald interval ("Adjusted Wald confidence interval for a difference of binomial
    proportions based on paired data", 2012): of the pairs that differ, with one added to either kind.
    """
    trials = len(first) + 2
    more, less = ((int(np.sum(one & ~other)) + 1) / trials for one, other in ((first, second), (second, first)))
    reach = Z * sqrt((more + less - (more - less) ** 2) / trials)
    return max(more - less - reach, -1.0), min(more - less + reach, 1.0)


def mean_interval(
    values: Sequence[float] | Float[np.ndarray, " values"], least: float = -inf, most: float = inf
) -> tuple[float, float]:
    """Return the 95 % interval of a mean over seeds, arenas or games by Student's t.

    Args:
        values: independent ones.
        least, most: what values can be at all. One value alone says no more than that.
    """
    if len(values) == 1:
        return least, most
    (low,), (high,) = mean_band(np.asarray(values, float)[:, None])
    return max(float(low), least), min(float(high), most)


def rate_interval(counts: Sequence[tuple[int, int]]) -> tuple[float, float]:
    """Return the 95 % interval of a rate: of one seed over its games, of several over the seeds.

    Over seeds it is Student's, which games make wider as they make seeds differ; but never narrower than Wilson's of
    all games together, for seeds that happen to agree, as (0, 2000) three times, know no more than their games do.

    Args:
        counts: how often it happened and how often it could have, of each seed.
    """
    times, trials = (sum(column) for column in zip(*counts, strict=True))
    of_games = wilson_interval(times, trials)
    if len(counts) == 1:
        return of_games
    low, high = mean_interval([here / there for here, there in counts], 0.0, 1.0)
    return min(low, of_games[0]), max(high, of_games[1])


def mean_band(curves: Float[np.ndarray, "seeds points"]) -> tuple[Float[np.ndarray, " points"], ...]:
    """Return the lower and the upper end of the 95 % interval of a mean curve over seeds, by Student's t.

    Wide with few seeds, as it should be (of three: 2.5 standard deviations either way), where a percentile bootstrap's
    would stay within their range and hold the mean in 3 of 4 studies. It takes seeds to be normally distributed.

    Raises:
        ValueError: for fewer than two seeds.
    """
    seeds = len(curves)
    if seeds < 2:
        raise ValueError(f"{seeds} seeds have no spread: give two at least")
    mean = curves.mean(axis=0)
    reach = scipy.stats.t.ppf(0.975, seeds - 1) * curves.std(axis=0, ddof=1) / sqrt(seeds)
    return mean - reach, mean + reach
