"""A player that learns how its robot drives while it drives."""

from dataclasses import replace

import jax.numpy as jnp

from apollonius.accelerate.fusion_barrier import fusion_barrier
from apollonius.agents.policy import AbstractPolicy, AbstractWrapper, Memory
from apollonius.game.drive import PredictedRobot, predict_after_lag
from apollonius.game.dynamics import Unicycle
from apollonius.game.types import Action, RandomBits, Real, Scalar
from apollonius.game.uncertainty import Uncertainty
from apollonius.observe.drive_estimate import DriveEstimate
from apollonius.observe.view import Robot, View


class Identifying(AbstractWrapper[AbstractPolicy]):
    """Another player, whose robot's drive and limits are estimated from its own motion
    (`apollonius.observe.drive_estimate`), whatever the game says.

    Attributes:
        nominal: the robot's limits as the game names them.
        noise: bounds of the errors of its states.
    """

    nominal: Unicycle
    noise: Uncertainty

    @property
    def memory(self) -> tuple[DriveEstimate, Memory]:
        """The estimate of the drive, and the memory of the player."""
        return DriveEstimate.at_start(), self.policy.memory

    def __call__(
        self, view: View, memory: tuple[DriveEstimate, Memory], bits: RandomBits
    ) -> tuple[Action, Memory]:
        before, own_memory = memory
        estimate = self.estimate_after(view, before)
        observation = self.policy.observation(self.view_of(view, estimate))
        action, own_memory = self.policy(observation, own_memory, bits)
        return action, (estimate.after_command(action), own_memory)

    def estimate_after(self, view: View, before: DriveEstimate) -> DriveEstimate:
        """Return the estimate after one more view."""
        return before.after_state(view.own.state, self.nominal, self.noise, view.dt)

    def view_of(self, view: View, estimate: DriveEstimate) -> View:
        """Return a view in which the robot drives as is estimated."""
        own, lag_time = self._as_estimated(view.own, estimate, view.dt)
        return replace(view, own=own, movers=view.movers and replace(view.movers, age=lag_time))

    @fusion_barrier
    def _as_estimated(
        self, robot: Robot, estimate: DriveEstimate, dt: Real
    ) -> tuple[Robot, Scalar]:
        """Return a robot that drives as is estimated, and by how much its commands are late [s]:
        what follows reads this many times.
        """
        estimated = estimate.drive(self.nominal, dt)
        body = replace(estimated.body, radius=robot.body.radius)
        now = PredictedRobot(
            robot.state, estimated.state.turn_rate, self.noise.plus(estimated.uncertainty)
        )
        soon = predict_after_lag(estimated.drive, estimated.state, body, now, dt)
        own = replace(
            robot,
            body=body,
            predicted_state=soon.robot,
            turn_time=estimated.drive.turn_time,
            turn_rate=soon.turn_rate,
            uncertainty=soon.uncertainty,
            command=estimated.command,
        )
        return own, jnp.asarray(estimated.drive.lag).astype(jnp.float32) * dt
