"""What each side is paid for a step: the paper's rewards (Eq. 8, 9) or the zero-sum profile."""

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Int

from apollonius.game.by_side import BySide
from apollonius.game.outcome import evader_wins, pursuer_wins
from apollonius.game.types import Outcome, Real, Scalar


class Reward(eqx.Module):
    """The rewards of both sides.

    Attributes:
        profile: `paper` (Eq. 8, 9) or `zero-sum` (+1 to the winner, -1 to the loser, 0 while the game goes on and
            when both fail in one step).
        capture: paid to the pursuer for a capture and taken from the evader (Eq. 8, 9); the other way round when the
            evader reaches a territory.
        failure: taken from a robot that hits an obstacle or leaves the walls (Eq. 8, 9).
        progress: weight c of the change in distance, per metre (Eq. 8, 9).
        zero_sum_within: how far [m] the robots' progress is zero-sum: beyond it the evader, too, is paid for coming
            closer (the partial zero-sum reward of Zhong et al., "AD-VAT", ICLR 2019); None is everywhere, as in Eq. 9.
    """

    profile: Literal["paper", "zero-sum"] = eqx.field(static=True, default="paper")
    capture: Real = 10.0
    failure: Real = 10.0
    progress: Real = 3.0
    zero_sum_within: Real | None = None

    @property
    def time_limit_wins(self) -> bool:
        """Whether outliving the time limit is the evader's win (and so terminal) rather than a truncation."""
        return self.profile == "zero-sum"

    def __call__(self, outcome: Int[Array, ""], distance_before: Scalar, distance_after: Scalar) -> BySide[Scalar]:
        """Either side's reward for one step.

        Args:
            outcome: how the game stands after the step.
            distance_before, distance_after: between the robots' centres [m].

        In the paper's profile a robot is paid for progress when only its opponent failed, as Eq. 8 and 9 have no
        case for that.
        """
        if self.profile == "zero-sum":
            win = pursuer_wins(outcome).astype(jnp.float32)
            loss = evader_wins(outcome, self.time_limit_wins).astype(jnp.float32)
            return BySide(win - loss, loss - win)
        both = outcome == Outcome.BOTH_FAILED
        pursuer_failed = both | (outcome == Outcome.PURSUER_HIT_OBSTACLE) | (outcome == Outcome.PURSUER_OUT_OF_RANGE)
        evader_failed = both | (outcome == Outcome.EVADER_HIT_OBSTACLE) | (outcome == Outcome.EVADER_OUT_OF_RANGE)
        captured, reached = outcome == Outcome.CAPTURED, outcome == Outcome.TERRITORY_REACHED
        closing = self.progress * (distance_before - distance_after)
        leaving = -closing
        if (within := self.zero_sum_within) is not None:
            beyond = jnp.maximum(distance_after - within, 0.0) - jnp.maximum(distance_before - within, 0.0)
            leaving = leaving - 2 * self.progress * beyond
        prize = jnp.where(captured, self.capture, -self.capture)
        pursuer = jnp.where(captured | reached, prize, jnp.where(pursuer_failed, -self.failure, closing))
        evader = jnp.where(captured | reached, -prize, jnp.where(evader_failed, -self.failure, leaving))
        return BySide(pursuer, evader)
