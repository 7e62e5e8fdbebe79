"""Only earlier versions, by the equilibrium of the game between all that are kept: policy-space response oracles.

Lanctot et al., "A unified game-theoretic approach to multiagent reinforcement learning" (2017), with the Nash solver.
"""

import numpy as np
from jaxtyping import Float

from apollonius.game.by_side import BySide
from apollonius.learn.opponents.scheme import AbstractScheme, Mixture
from apollonius.matrix_game import equilibrium


class PSRO(AbstractScheme):
    """Every game with a version, drawn by the minimax mixtures of the matrix of their matches."""

    share = 1.0
    keeps_payoffs = True

    def mix(self, payoffs: Float[np.ndarray, "pursuers evaders"]) -> BySide[Mixture]:
        """The minimax mixtures."""
        mixed = equilibrium(payoffs)
        return BySide(mixed.rows, mixed.columns)


SCHEME = PSRO()
