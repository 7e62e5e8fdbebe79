"""Networks of PyTorch as wide as all entrants."""

# pyright: reportMissingImports=false

from collections.abc import Callable
from typing import Any

import torch

from benchmarks.entrants.game import HIDDEN, OBSERVATION


def make_layers(
    outputs: int, start: Callable[[Any, float], Any] = lambda linear, gain: linear
) -> Any:
    """Make linear layers with ReLU between them.

    Args:
        outputs: numbers that the last layer makes.
        start: draws the weights of a linear layer, given the gain: 2**0.5, or 0.01 for the logits
            of several actions and 1 for a value.
    """
    modules: list[Any] = []
    size = OBSERVATION.size
    for units in HIDDEN:
        modules += [start(torch.nn.Linear(size, units), 2**0.5), torch.nn.ReLU()]
        size = units
    last_gain = 0.01 if outputs > 1 else 1.0
    return torch.nn.Sequential(*modules, start(torch.nn.Linear(size, outputs), last_gain))
