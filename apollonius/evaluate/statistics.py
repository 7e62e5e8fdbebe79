"""How sure a rate is."""

from scipy.stats import binomtest


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
    interval = binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    return float(interval.low), float(interval.high)
