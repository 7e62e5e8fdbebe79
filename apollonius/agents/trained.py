"""Who plays by a trained network: at its best, or exploring."""

from apollonius.agents.greedy import EpsilonGreedy, Greedy
from apollonius.agents.network import Network, QNetwork
from apollonius.agents.squashed import SquashedGaussian, SquashedMean
from apollonius.game.types import Scalar


def at_best(network: Network) -> Greedy | SquashedMean:
    """The player that does what the network thinks best."""
    return Greedy(network) if isinstance(network, QNetwork) else SquashedMean(network)


def exploring(network: Network, amount: Scalar) -> EpsilonGreedy | SquashedGaussian:
    """The player that deviates from it, by chance: by an amount of 0 never.

    Args:
        amount: of action values, the share of random actions; of a distribution, what its standard deviations are
            multiplied by.
    """
    return EpsilonGreedy(network, amount) if isinstance(network, QNetwork) else SquashedGaussian(network, amount)
