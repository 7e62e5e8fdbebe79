"""The estimate of a robot's drive, from its own commands and its motion.

Each pair of a lag and a turn time is a hypothesis. Under each, the turn rates of the past steps are
a known multiple of the largest turn rate, and the accelerations one of the largest acceleration, so
that least squares give both limits. How far the motion is from each hypothesis says how likely it
is (a bank of models: Magill, "Optimal adaptive estimation of sampled stochastic processes", 1965).
"""

from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.game.drive import MOST_LAG, Drive, limited_turn_rate
from apollonius.game.dynamics import Unicycle, action_levels, wrap_angle
from apollonius.game.types import Action, Controls, DriveState, Flag, Real, RobotState, Scalar
from apollonius.game.uncertainty import Uncertainty

LAGS = 6
"""Lags that are thought possible: 0 to 5 steps."""
TURN_TIMES = 20
"""Turn times that are compared."""
TURN_TIME_STEP = 0.05
"""Difference of two turn times [s]; the first is 0 s."""
LIMITS = 0.25
"""Share by which limits are thought to differ from those that the game names."""
_PRIOR = 1 / (LIMITS / 2) ** 2
"""Weight of the limits that the game names, in observations of unit error."""
_TURN_ERROR, _SPEED_ERROR = 0.04, 0.05
"""Standard deviations of what no hypothesis explains: shares of the largest turn rate, and of the
largest change of speed in a step."""
_TOP = 0.7
"""Share of the top speed from which a robot may have reached it."""
_UNLIKELY = 1e-3
"""Probability below which a lag counts as impossible."""
_DEVIATIONS = 3.0
"""Standard deviations within which a number is taken to be."""


class Fit(NamedTuple):
    """Sums of the least squares of a limit under each hypothesis: of products of the predicted and
    the measured motion, in standard deviations.
    """

    predicted: Float[Array, "lags *turn_times"]
    product: Float[Array, "lags *turn_times"]
    measured: Float[Array, "lags *turn_times"]

    def add(self, predicted: Array, measured: Array) -> "Fit":
        """Return the sums with one more step."""
        return Fit(
            self.predicted + predicted**2,
            self.product + predicted * measured,
            self.measured + measured**2,
        )

    @property
    def share(self) -> Array:
        """The limit as a share of the one that the game names."""
        return (self.product + _PRIOR) / (self.predicted + _PRIOR)

    @property
    def deviation(self) -> Array:
        """The standard deviation of that share."""
        return 1 / jnp.sqrt(self.predicted + _PRIOR)

    @property
    def misfit(self) -> Array:
        """The squared distance between the motion and what the hypothesis makes of it."""
        weighted = (self.product + _PRIOR) * self.share
        return jnp.maximum(self.measured + _PRIOR - weighted, 0.0)


class DriveEstimate(eqx.Module):
    """An estimate of a robot's drive.

    Attributes:
        steps: the number of states that it has seen.
        last: the latest of these.
        levels: its latest commands as shares of the limits, the newest first.
        turn_rates: under each hypothesis, as a share of the largest one.
        turning, speeding: fits of the largest turn rate and of the largest acceleration.
        fastest: the highest speed so far [m/s].
        has_topped: whether it went on speeding up in vain, so that this is its top speed.
    """

    steps: Int[Array, ""]
    last: RobotState
    levels: Float[Array, "lag 2"]
    turn_rates: Float[Array, "lags turn_times"]
    turning: Fit
    speeding: Fit
    fastest: Scalar
    has_topped: Flag

    @classmethod
    def at_start(cls) -> "DriveEstimate":
        """Return the estimate of a robot that has not moved."""
        hypotheses, lags = jnp.zeros((LAGS, TURN_TIMES)), jnp.zeros(LAGS)
        zero = jnp.zeros(())
        return cls(
            steps=jnp.int32(0),
            last=RobotState(zero, zero, zero, zero),
            levels=jnp.zeros((MOST_LAG, 2)),
            turn_rates=hypotheses,
            turning=Fit(hypotheses, hypotheses, hypotheses),
            speeding=Fit(lags, lags, lags),
            fastest=zero,
            has_topped=jnp.zeros((), bool),
        )

    def after_command(self, action: Action) -> "DriveEstimate":
        """Return the estimate after the robot was given an action."""
        levels = jnp.stack(action_levels(action))
        return replace(self, levels=jnp.concatenate([levels[None], self.levels[:-1]]))

    def after_state(
        self, robot: RobotState, nominal: Unicycle, noise: Uncertainty, dt: Real
    ) -> "DriveEstimate":
        """Return the estimate after one more state.

        Args:
            robot: the robot's state now, as it knows it.
            nominal: its limits as the game names them.
            noise: bounds of the errors of its states.
            dt: duration of a step [s].
        """
        is_first = self.steps == 0
        u1, u2 = self.levels[:LAGS].T
        turning, turn_rates = self._turning_after(robot, u2, nominal, noise, dt)
        speeding = self._speeding_after(robot, u1, nominal, noise, dt)
        after = replace(
            self,
            turn_rates=turn_rates,
            turning=turning,
            speeding=speeding,
            fastest=jnp.maximum(self.fastest, robot.v - noise.speed),
            has_topped=self.has_topped | self._tops(robot, u1, nominal, noise, dt),
        )
        estimate = jax.tree.map(lambda old, new: jnp.where(is_first, old, new), self, after)
        return replace(estimate, steps=self.steps + 1, last=robot)

    def _tops(
        self,
        robot: RobotState,
        u1: Float[Array, " lags"],
        nominal: Unicycle,
        noise: Uncertainty,
        dt: Real,
    ) -> Flag:
        """Check whether the robot gained almost no speed, though it was to speed up whatever its
        lag.
        """
        least_gain = (1 - LIMITS) * nominal.u1_max * dt
        gain = robot.v - self.last.v + 2 * noise.speed
        return jnp.all(u1 > 0) & (robot.v >= _TOP * nominal.v_max) & (gain < least_gain / 3)

    def _turning_after(
        self,
        robot: RobotState,
        u2: Float[Array, " lags"],
        nominal: Unicycle,
        noise: Uncertainty,
        dt: Real,
    ) -> tuple[Fit, Float[Array, "lags turn_times"]]:
        """Return the fit of the largest turn rate, and the turn rates under each hypothesis."""
        unit = Unicycle(u2_max=1.0)
        turn_times = TURN_TIME_STEP * jnp.arange(TURN_TIMES, dtype=jnp.float32)

        def one_turn(turn_time: Scalar, rate: Scalar, command: Scalar) -> tuple[Scalar, Scalar]:
            mean, after = limited_turn_rate(unit, turn_time, rate, command, dt)
            assert after is not None, "a drive with a turn time has a turn rate"
            return mean, after

        over_turn_times = jax.vmap(one_turn, (0, 0, None))
        means, rates = jax.vmap(over_turn_times, (None, 0, 0))(turn_times, self.turn_rates, u2)
        measured = wrap_angle(robot.heading - self.last.heading) / dt
        error = _TURN_ERROR * nominal.u2_max + noise.heading / dt
        return self.turning.add(means * nominal.u2_max / error, measured / error), rates

    def _speeding_after(
        self,
        robot: RobotState,
        u1: Float[Array, " lags"],
        nominal: Unicycle,
        noise: Uncertainty,
        dt: Real,
    ) -> Fit:
        """Return the fit of the largest acceleration.

        A step in which the speed may have been held by its limits says nothing.
        """
        may_be_fastest = (u1 > 0) & (self.last.v >= _TOP * nominal.v_max)
        slowest = nominal.v_min + noise.speed
        may_be_slowest = (u1 < 0) & (robot.v <= slowest + 1e-3)
        says_something = ~(may_be_fastest | may_be_slowest)
        error = _SPEED_ERROR * nominal.u1_max * dt + noise.speed
        predicted = jnp.where(says_something, u1 * nominal.u1_max * dt / error, 0.0)
        measured = jnp.where(says_something, (robot.v - self.last.v) / error, 0.0)
        return self.speeding.add(predicted, measured)

    def drive(self, nominal: Unicycle, dt: Real) -> "EstimatedDrive":
        """Return the most likely drive, and by how much the true one may differ.

        Args:
            nominal: the robot's limits as the game names them.
            dt: duration of a step [s].
        """
        misfit = self.turning.misfit + self.speeding.misfit[:, None]
        likelihood = jax.nn.softmax(-misfit.ravel() / 2).reshape(misfit.shape)
        by_lag = jnp.sum(likelihood, axis=1)
        lag = jnp.argmax(by_lag)
        lags = jnp.arange(LAGS)
        lag_errors = jnp.where(by_lag > _UNLIKELY, jnp.abs(lags - lag), 0)
        by_time = likelihood[lag] / jnp.maximum(by_lag[lag], 1e-9)
        times = TURN_TIME_STEP * jnp.arange(TURN_TIMES, dtype=jnp.float32)
        turn_time = by_time @ times
        spread = jnp.sqrt(by_time @ (times - turn_time) ** 2)
        shares, deviations = self.turning.share[lag], self.turning.deviation[lag]
        turning = by_time @ shares
        deviation = jnp.sqrt(by_time @ (deviations**2 + (shares - turning) ** 2))
        speeding = self.speeding.share[lag]
        body = replace(
            nominal,
            v_max=jnp.where(self.has_topped, self.fastest, (1 + LIMITS) * nominal.v_max),
            u1_max=nominal.u1_max * speeding,
            u2_max=nominal.u2_max * turning,
        )
        rate = by_time @ self.turn_rates[lag] * body.u2_max
        limits = jnp.stack([body.u1_max, body.u2_max])
        return EstimatedDrive(
            body=body,
            drive=Drive(lag, turn_time),
            state=DriveState(self.levels * limits[None], rate),
            uncertainty=Uncertainty(
                delay=jnp.max(lag_errors).astype(jnp.float32) * dt,
                acceleration=_share(self.speeding.deviation[lag] / speeding),
                turning=_share(deviation / turning),
                turn_delay=_DEVIATIONS * spread + TURN_TIME_STEP / 2,
            ),
        )


class EstimatedDrive(NamedTuple):
    """The most likely drive of a robot, its limits, and by how much the true ones may differ."""

    body: Unicycle
    drive: Drive
    state: DriveState
    uncertainty: Uncertainty

    @property
    def command(self) -> Controls:
        """The latest command, u1 [m/s^2] and u2 [rad/s]."""
        assert self.state.pending is not None, "it remembers its commands"
        u1, u2 = self.state.pending[0]
        return u1, u2


def _share(deviation: Scalar) -> Scalar:
    """Return the share by which a limit may differ, of its relative standard deviation."""
    return jnp.minimum(_DEVIATIONS * deviation, 2 * LIMITS)
