"""What a side reads that is told the opponent's observation and action before it decides."""

from dataclasses import dataclass, replace

import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.errors import InvalidInput
from apollonius.observe.encoded import ENCODED
from apollonius.observe.observation import AbstractObservation
from apollonius.observe.view import View


@dataclass(frozen=True)
class OpponentAware(AbstractObservation):
    """`encoded` as the robot sees it (17), as its opponent sees it (17), and the opponent's controls in the step to
    come over their largest (2).

    The inputs of the target in Zhong et al., "AD-VAT: An asymmetric dueling mechanism for learning visual active
    tracking" (ICLR 2019): there they let it know the tracker better while it trains the tracker. In a game without
    secrets only the controls are new to it.
    """

    name = "opponent-aware"
    size = 2 * ENCODED.size + 2
    is_told = True

    def __call__(self, view: View) -> Float[Array, "36"]:
        """The thirty-six numbers.

        Raises:
            InvalidInput: where nobody tells what the opponent does next.
        """
        if view.announced is None:
            raise InvalidInput(
                f"'{self.name}' reads what the opponent does next, which only matches and trainings tell, and only if "
                "the opponent is not told in turn: take another observation."
            )
        opponent, (u1, u2) = view.opponent, view.announced
        theirs = replace(view, own=opponent, opponents=(view.own,))
        limits = opponent.body.u1_max, opponent.body.u2_max
        controls = jnp.stack([u1 / jnp.maximum(limits[0], 1e-6), u2 / jnp.maximum(limits[1], 1e-6)])
        return jnp.concatenate([ENCODED(view), ENCODED(theirs), controls])


OPPONENT_AWARE = OpponentAware()
