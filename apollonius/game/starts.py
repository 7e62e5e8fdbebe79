"""Where games begin: the distributions of initial states."""

from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.types import GameState, Real, RobotState, Scalar


class Starts(eqx.Module):
    """Both robots uniform in the free space, apart from each other, headings uniform.

    Attributes:
        speed: `rest` (v = 0, or the slowest the robot can go) or `moving` (v uniform between the robot's limits;
            some of these starts are lost before they begin).
        clearance: least distance of a robot's body from walls and obstacles [m].
        separation: least distance between the robots' centres, and of the evader from a territory [m].
    """

    speed: Literal["rest", "moving"] = eqx.field(static=True, default="rest")
    clearance: Real = 0.3
    separation: Real = 1.0

    def sample(self, key: PRNGKeyArray, arena: Arena, pursuer: Unicycle, evader: Unicycle) -> GameState:
        """One initial state. The key is consumed.

        Positions are drawn again until they fit, so the distribution is exactly uniform over the pairs that do.
        """
        position_key, heading_key, speed_key = jax.random.split(key, 3)
        low = jnp.array([arena.x_min, arena.y_min] * 2, jnp.float32)
        high = jnp.array([arena.x_max, arena.y_max] * 2, jnp.float32)

        def draw_positions(draw_key: PRNGKeyArray) -> Float[Array, "4"]:
            return jax.random.uniform(draw_key, (4,), minval=low, maxval=high)

        def redraw(carry: tuple[PRNGKeyArray, Float[Array, "4"]]) -> tuple[PRNGKeyArray, Float[Array, "4"]]:
            next_key, draw_key = jax.random.split(carry[0])
            return next_key, draw_positions(draw_key)

        first_key, retry_key = jax.random.split(position_key)
        _, (px, py, ex, ey) = jax.lax.while_loop(
            lambda carry: ~self.fits(arena, pursuer, evader, *carry[1]), redraw, (retry_key, draw_positions(first_key))
        )
        headings = jax.random.uniform(heading_key, (2,), minval=-jnp.pi, maxval=jnp.pi)
        v_pursuer, v_evader = self._speeds(speed_key, pursuer, evader)
        return GameState.of_two(
            pursuer=RobotState(px, py, v_pursuer, headings[0]),
            evader=RobotState(ex, ey, v_evader, headings[1]),
            steps=jnp.zeros((), jnp.int32),
        )

    def fits(
        self, arena: Arena, pursuer: Unicycle, evader: Unicycle, px: Scalar, py: Scalar, ex: Scalar, ey: Scalar
    ) -> Bool[Array, ""]:
        """Whether two positions [m] are far enough from the obstacles and from each other."""
        fits = (
            (arena.clearance(px, py) >= self.clearance + pursuer.radius)
            & (arena.clearance(ex, ey) >= self.clearance + evader.radius)
            & (jnp.hypot(px - ex, py - ey) >= self.separation)
        )
        if arena.territory:
            goal = arena.territory
            fits = fits & (jnp.hypot(ex - goal.x, ey - goal.y) >= goal.radius + self.separation)
        return fits

    def _speeds(self, key: PRNGKeyArray, pursuer: Unicycle, evader: Unicycle) -> tuple[Scalar, Scalar]:
        slowest = jnp.array([jnp.maximum(pursuer.v_min, 0.0), jnp.maximum(evader.v_min, 0.0)], jnp.float32)
        if self.speed == "moving":
            low = jnp.array([pursuer.v_min, evader.v_min], jnp.float32)
            high = jnp.array([pursuer.v_max, evader.v_max], jnp.float32)
            speeds = jax.random.uniform(key, (2,), minval=low, maxval=high)
        else:
            speeds = slowest
        return speeds[0], speeds[1]
