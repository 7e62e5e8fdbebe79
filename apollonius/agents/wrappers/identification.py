"""A player that is not told how its robot drives, and learns it while it drives."""

from dataclasses import replace

from apollonius.agents.policy import AbstractPolicy, AbstractWrapper, Memory
from apollonius.game.drive import Prediction, predict_after_lag
from apollonius.game.dynamics import Unicycle
from apollonius.game.types import Action, RandomBits
from apollonius.game.uncertainty import Uncertainty
from apollonius.observe.drive_estimate import DriveEstimate
from apollonius.observe.view import View


class Identifying(AbstractWrapper[AbstractPolicy]):
    """Another player, whose robot's drive and limits are estimated from its own motion
    (`apollonius.observe.drive_estimate`), whatever the game says of them.

    Attributes:
        nominal: the robot's limits as the game names them.
        known: bounds of the errors of its states.
    """

    nominal: Unicycle
    known: Uncertainty

    @property
    def memory(self) -> tuple[DriveEstimate, Memory]:
        """What is learnt of the drive, and the memory of the player."""
        return DriveEstimate.at_start(), self.policy.memory

    def __call__(
        self, view: View, memory: tuple[DriveEstimate, Memory], bits: RandomBits
    ) -> tuple[Action, Memory]:
        before, own_memory = memory
        estimate = before.after_state(view.own.state, self.nominal, self.known, view.dt)
        seen = self.policy.observation(self.view_of(view, estimate))
        action, own_memory = self.policy(seen, own_memory, bits)
        return action, (estimate.after_command(action), own_memory)

    def view_of(self, view: View, estimate: DriveEstimate) -> View:
        """Return a view in which the robot drives as is estimated."""
        estimated = estimate.drive(self.nominal, view.dt)
        body = replace(estimated.body, radius=view.own.body.radius)
        now = Prediction(
            view.own.state, estimated.state.turn_rate, self.known.plus(estimated.uncertainty)
        )
        soon = predict_after_lag(estimated.drive, estimated.state, body, now, view.dt)
        u1, u2 = estimated.state.pending[0]
        own = replace(
            view.own,
            body=body,
            predicted_state=soon.robot,
            turn_time=estimated.drive.turn_time,
            turn_rate=soon.turn_rate,
            uncertainty=soon.uncertainty,
            command=(u1, u2),
        )
        return replace(view, own=own)
