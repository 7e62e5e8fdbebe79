"""Tables in Markdown, and how a mean over seeds is written in them."""

from collections.abc import Sequence

import numpy as np

from apollonius.evaluate.statistics import mean_interval


def markdown_row(cells: Sequence[str]) -> str:
    """A line of a table, without a newline."""
    return "| " + " | ".join(cells) + " |"


def markdown_head(cells: Sequence[str]) -> str:
    """The first two lines of a table."""
    return markdown_row(cells) + "\n" + markdown_row(["---"] * len(cells))


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A whole table, without a newline at its end."""
    return "\n".join([markdown_head(head), *map(markdown_row, rows)])


def mean_over_seeds(values: Sequence[float], form: str) -> str:
    """The mean and, where there are several seeds, how far its 95 % interval reaches (Student's t); "-" of nothing.

    Args:
        values: one of each seed.
        form: how a number is written, "{:.1f}" for instance.
    """
    if not values:
        return "-"
    middle = form.format(float(np.mean(values)))
    if len(values) < 2:
        return middle
    low, high = mean_interval(values)
    return f"{middle} ± {form.format((high - low) / 2)}"
