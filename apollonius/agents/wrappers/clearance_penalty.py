"""A player that keeps clear of walls: another one's action values, less a penalty for actions that
leave too little clearance.

What a network learns of walls and bodies is blurred, and teaching it the sharp edge of what a
shield forbids costs it the differences between good actions. So the edge is not learned: it is read
from the observation, which has the clearance that each action leaves a robot which then brakes
(`apollonius.observe.braking`).
"""

from typing import Any

import jax
from jaxtyping import Array, Float

from apollonius.agents.policy import AbstractValueWrapper, Memory
from apollonius.game.types import NUM_ACTIONS, RandomBits, Real
from apollonius.observe.egocentric import BRAKING, ROOM
from apollonius.observe.observation import RawView

COST = 30.0
"""Cost of a metre of missing clearance, in lost games, on the scale of the paper's robots: of 3 cm,
most of one.
"""


def action_penalties(
    observations: Float[Array, "*rows size"], margin: Real, loss_value: Real
) -> Float[Array, "*rows 9"]:
    """Compute the penalty of each action that leaves less than the clearance margin.

    Args:
        observations: `egocentric`, or those that begin with it.
        margin: the clearance that an action should leave a robot that then brakes [m].
        loss_value: value of a lost game.
    """
    after = observations[..., BRAKING : BRAKING + NUM_ACTIONS]
    return COST * ROOM * loss_value * jax.nn.relu(margin / ROOM - after)


class ClearancePenalty(AbstractValueWrapper):
    """Another player with the `action_penalties` in its action values.

    Attributes:
        policy: reads `egocentric`, or an observation that begins with it.
        margin: the clearance that an action should leave a robot that then brakes [m].
        loss_value: value of a lost game, in the units of the other's values.
    """

    margin: Real
    loss_value: Real

    @property
    def observation(self) -> RawView:
        return self.policy.observation

    def score(
        self, observation: Any, memory: Memory, bits: RandomBits
    ) -> tuple[Float[Array, "9"], Memory]:
        values, memory = self.policy.score(observation, memory, bits)
        return values - action_penalties(observation, self.margin, self.loss_value), memory
