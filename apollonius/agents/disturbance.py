"""Between a player and its robot: senses that err, commands that come late, drives weaker or slower than the rules say.

Training that meets many such robots learns to leave room for the one it will drive: domain randomisation (Tobin et al.,
2017; of dynamics Peng et al., "Sim-to-Real Transfer of Robotic Control with Dynamics Randomization", 2018). The rules
know nothing of it, and the judge does not use it.
"""

from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt32

from apollonius.game.by_side import BySide, one_each
from apollonius.game.dynamics import Unicycle, wrap_angle
from apollonius.game.game import Game
from apollonius.game.types import ROLES, Action, GameState, Real, RobotState, Role, Scalar, Timestep
from apollonius.io.errors import require_within

_HANDICAP, _NOISE = 1, 2
"""Numbers folded into random bits for handicaps and for noise, beside the player's own use of the bits."""


@dataclass(frozen=True)
class Disturbance:
    """Departures of robots in training from the rules, drawn for each robot of each game."""

    delay: int = 0
    """Commands are late by a number of steps drawn from 0 to this."""
    limits: float = 0.0
    """The largest acceleration and turn rate are multiplied by numbers drawn from 1 - this to 1 + this, the top speed
    by one from 1 - this to 1."""
    turn_time: float = 0.0
    """The drive takes a time drawn from 0 to this to change its turn rate by u2_max [s]."""
    position_noise: float = 0.0
    """Standard deviation of the error of a seen x or y [m]; all errors are drawn in every step."""
    speed_noise: float = 0.0
    """Standard deviation of the error of a seen speed [m/s]."""
    heading_noise: float = 0.0
    """Standard deviation of the error of a seen heading [rad]."""

    def __post_init__(self) -> None:
        require_within(self, 0, 100, "delay")
        require_within(self, 0, 0.99, "limits")
        require_within(self, 0, 1000, "turn_time", "position_noise", "speed_noise", "heading_noise")

    @property
    def has_sensor_noise(self) -> bool:
        return self.position_noise > 0 or self.speed_noise > 0 or self.heading_noise > 0


NONE = Disturbance()
"""Robots as the rules have them."""


class Handicap(eqx.Module):
    """One robot's departure from the rules in one game, and what of its past still matters.

    Attributes:
        delay: by how many steps its commands are late.
        factors: of its top speed, largest acceleration and largest turn rate.
        turn_time: what it takes to change its turn rate by u2_max [s].
        turn_rate: at present [rad/s].
        pending: the latest commands, u1 [m/s^2] and u2 [rad/s], the newest first.
    """

    delay: Int[Array, "*batch"]
    factors: Float[Array, "*batch 3"]
    turn_time: Float[Array, "*batch"]
    turn_rate: Float[Array, "*batch"]
    pending: Float[Array, "*batch delay 2"]

    def respond(
        self, body: Unicycle, robot: RobotState, action: Action, dt: Real
    ) -> tuple[tuple[Scalar, Scalar], "Handicap"]:
        """Return the controls that move the rules' robot in this step as this one moves, and the handicap after it.

        A turn rate that changes at a constant rate until it is reached turns the robot by its mean over the step.
        """
        known = jnp.concatenate([jnp.stack(body.controls(action))[None], self.pending])
        u1, u2 = known[self.delay] * self.factors[1:]
        u1 = jnp.maximum(jnp.minimum(u1, (self.factors[0] * body.v_max - robot.v) / dt), -body.u1_max)
        change = u2 - self.turn_rate
        most = body.u2_max * dt / jnp.maximum(self.turn_time, 1e-6)
        made = jnp.clip(change, -most, most)
        mean = self.turn_rate + made - made * jnp.abs(made) / (2 * most)
        return (u1, mean), replace(self, turn_rate=self.turn_rate + made, pending=known[: self.pending.shape[0]])


def draw_handicap(bits: UInt32[Array, ""], disturbance: Disturbance) -> Handicap:
    """Draw a robot's handicap for a game that begins, from random bits. Its past is one at rest."""
    shares = jax.random.uniform(jax.random.fold_in(jax.random.key(bits), _HANDICAP), (5,))
    spread = disturbance.limits * (2 * shares[:3] - 1)
    return Handicap(
        delay=jnp.floor(shares[3] * (disturbance.delay + 1)).astype(jnp.int32),
        factors=1 + spread.at[0].set(-disturbance.limits * shares[0]),
        turn_time=disturbance.turn_time * shares[4],
        turn_rate=jnp.zeros(()),
        pending=jnp.zeros((disturbance.delay, 2)),
    )


def with_sensor_noise(state: GameState, bits: UInt32[Array, ""], disturbance: Disturbance) -> GameState:
    """Return a state as one side sees it: all robots with errors of their own, from random bits."""
    if not disturbance.has_sensor_noise:
        return state
    robots, sides = jax.tree.flatten(state.robots, is_leaf=lambda node: isinstance(node, RobotState))
    errors = jax.random.normal(jax.random.fold_in(jax.random.key(bits), _NOISE), (len(robots), 4))

    def seen(robot: RobotState, error: Float[Array, "4"]) -> RobotState:
        return RobotState(
            x=robot.x + disturbance.position_noise * error[0],
            y=robot.y + disturbance.position_noise * error[1],
            v=robot.v + disturbance.speed_noise * error[2],
            heading=wrap_angle(robot.heading + disturbance.heading_noise * error[3]),
        )

    return replace(state, robots=jax.tree.unflatten(sides, map(seen, robots, errors)))


def step_disturbed(
    game: Game, state: GameState, handicaps: BySide[Handicap | None], actions: BySide[tuple[Action, ...]]
) -> tuple[Timestep, BySide[Handicap | None]]:
    """Step a game by the rules or, with handicaps, by the controls that these make of the actions.

    Raises:
        InvalidInput: for handicaps in a game of teams.
    """
    bodies = game.at(state).bodies

    def response(role: Role) -> tuple[tuple[tuple[Scalar, Scalar], ...], Handicap | None]:
        handicap = handicaps[role]
        if handicap is None:
            robots = zip(bodies[role], actions[role], strict=True)
            return tuple(body.controls(action) for body, action in robots), None
        body, robot = one_each(bodies)[role], one_each(state.robots)[role]
        controls, handicap = handicap.respond(body, robot, one_each(actions)[role], game.dt)
        return (controls,), handicap

    responses = ROLES.map(response)
    after = game.step_controls(state, responses.map(lambda response: response[0]))
    return after, responses.map(lambda response: response[1])
