"""The distributions of initial states."""

from collections.abc import Callable, Sequence
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from apollonius.game.arena import Arena
from apollonius.game.by_side import BySide
from apollonius.game.dynamics import Unicycle
from apollonius.game.types import ROLES, GameState, Real, RobotState, Role, Scalar
from apollonius.io.errors import require


class Starts(eqx.Module):
    """Robots uniform in the free space, apart from each other, headings uniform.

    Attributes:
        speed: `rest` (v = 0, or the robot's lowest) or `moving` (v uniform between the robot's limits; from some of
            these starts a crash is certain).
        clearance: least distance of a robot's body from walls, obstacles and the bodies of its mates [m].
        separation: least distance between the centres of opponents, and of evaders from a territory [m].
    """

    speed: Literal["rest", "moving"] = eqx.field(static=True, default="rest")
    clearance: Real = 0.3
    separation: Real = 1.0

    def check(self, capture_distance: Real) -> None:
        """Refuse impossible names and numbers."""
        require(self.speed in ("rest", "moving"), "starts.speed", self.speed, "rest or moving")
        require(self.clearance >= 0, "starts.clearance", self.clearance, "0 m or more")
        bound = f"at least capture_distance = {capture_distance} m, or games would be over before they begin"
        require(self.separation >= capture_distance, "starts.separation", self.separation, bound)

    def sample(self, key: PRNGKeyArray, arena: Arena, bodies: BySide[tuple[Unicycle, ...]]) -> GameState:
        """Draw an initial state. The key is consumed.

        The positions of both sides' first robots are drawn together, again until they fit, so the distribution is
        exactly uniform over the pairs that fit; then their mates', one by one, each uniform in the space that is left.
        """
        order = [(role, number) for role in ROLES for number in range(1, len(bodies[role]))]
        position_key, heading_key, speed_key, *mate_keys = jax.random.split(key, 3 + len(order))
        first, other = bodies.pursuer[0], bodies.evader[0]
        pair = _draw_until(lambda places: self._fit(arena, first, other, *places), position_key, arena, 2)
        headings = jax.random.uniform(heading_key, (2,), minval=-jnp.pi, maxval=jnp.pi)
        speeds = self._speeds(speed_key, [first, other])
        robots = BySide(
            [RobotState(pair[0], pair[1], speeds[0], headings[0])],
            [RobotState(pair[2], pair[3], speeds[1], headings[1])],
        )
        for (role, number), mate_key in zip(order, mate_keys, strict=True):
            robots[role].append(self._mate(mate_key, arena, bodies, robots, role, number))
        return GameState.at_start(robots.map(tuple))

    def _mate(
        self,
        key: PRNGKeyArray,
        arena: Arena,
        bodies: BySide[tuple[Unicycle, ...]],
        robots: BySide[list[RobotState]],
        role: Role,
        number: int,
    ) -> RobotState:
        """Draw a further robot of a side. The key is consumed."""
        position_key, heading_key, speed_key = jax.random.split(key, 3)
        body = bodies[role][number]

        def fits(place: Float[Array, "2"]) -> Bool[Array, ""]:
            x, y = place
            found = arena.clearance(x, y) >= self.clearance + body.radius
            for mate, other in zip(robots[role], bodies[role], strict=False):
                found &= jnp.hypot(x - mate.x, y - mate.y) >= self.clearance + body.radius + other.radius
            for opponent in robots[role.other]:
                found &= jnp.hypot(x - opponent.x, y - opponent.y) >= self.separation
            return found & self._is_off_territory(arena, x, y) if role == Role.EVADER else found

        x, y = _draw_until(fits, position_key, arena, 1)
        heading = jax.random.uniform(heading_key, (), minval=-jnp.pi, maxval=jnp.pi)
        return RobotState(x, y, self._speeds(speed_key, [body])[0], heading)

    def _fit(
        self, arena: Arena, pursuer: Unicycle, evader: Unicycle, px: Scalar, py: Scalar, ex: Scalar, ey: Scalar
    ) -> Bool[Array, ""]:
        """Return whether the positions [m] of two opponents are far enough from obstacles and from each other."""
        return (
            (arena.clearance(px, py) >= self.clearance + pursuer.radius)
            & (arena.clearance(ex, ey) >= self.clearance + evader.radius)
            & (jnp.hypot(px - ex, py - ey) >= self.separation)
            & self._is_off_territory(arena, ex, ey)
        )

    def _is_off_territory(self, arena: Arena, x: Scalar, y: Scalar) -> Bool[Array, ""]:
        if (goal := arena.territory) is None:
            return jnp.ones((), bool)
        return jnp.hypot(x - goal.x, y - goal.y) >= goal.radius + self.separation

    def _speeds(self, key: PRNGKeyArray, bodies: Sequence[Unicycle]) -> Float[Array, " robots"]:
        if self.speed == "rest":
            return jnp.array([jnp.maximum(body.v_min, 0.0) for body in bodies], jnp.float32)
        low = jnp.array([body.v_min for body in bodies], jnp.float32)
        high = jnp.array([body.v_max for body in bodies], jnp.float32)
        return jax.random.uniform(key, (len(bodies),), minval=low, maxval=high)


def _draw_until(
    fits: Callable[[Float[Array, " size"]], Bool[Array, ""]], key: PRNGKeyArray, arena: Arena, robots: int
) -> Float[Array, " size"]:
    """Draw x and y of some robots uniformly in an arena until they fit. The key is consumed."""
    low = jnp.array([arena.x_min, arena.y_min] * robots, jnp.float32)
    high = jnp.array([arena.x_max, arena.y_max] * robots, jnp.float32)

    def draw(draw_key: PRNGKeyArray) -> Float[Array, " size"]:
        return jax.random.uniform(draw_key, low.shape, minval=low, maxval=high)

    def redraw(carry: tuple[PRNGKeyArray, Float[Array, " size"]]) -> tuple[PRNGKeyArray, Float[Array, " size"]]:
        next_key, draw_key = jax.random.split(carry[0])
        return next_key, draw(draw_key)

    first_key, retry_key = jax.random.split(key)
    return jax.lax.while_loop(lambda carry: ~fits(carry[1]), redraw, (retry_key, draw(first_key)))[1]
