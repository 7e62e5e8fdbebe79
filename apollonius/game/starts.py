"""The distributions of initial states."""

import functools
import operator
from collections.abc import Callable, Sequence
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.types import ROLES, BySide, Flag, GameState, Real, RobotState, Role
from apollonius.io.errors import require

_Placed = tuple[Role, Unicycle, RobotState]
"""A robot of a side in its place."""


class Starts(eqx.Module):
    """The distribution of starts: robots uniform in the free space, apart from each other, headings uniform.

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
        mates = [[(role, body)] for role in ROLES for body in bodies[role][1:]]
        keys = jax.random.split(key, 3 + len(mates))
        placed = self._drawn([*keys[:3]], arena, [(role, bodies[role][0]) for role in ROLES], [])
        for mate, mate_key in zip(mates, keys[3:], strict=True):
            placed += self._drawn([*jax.random.split(mate_key, 3)], arena, mate, placed)
        return GameState.at_start(ROLES.map(lambda role: tuple(robot for side, _, robot in placed if side == role)))

    def _drawn(
        self,
        keys: Sequence[PRNGKeyArray],
        arena: Arena,
        new: Sequence[tuple[Role, Unicycle]],
        placed: Sequence[_Placed],
    ) -> list[_Placed]:
        """Draw some robots together, beside those that are placed. The three keys are consumed."""
        position_key, heading_key, speed_key = keys

        def robots(places: Array, speeds: Array, headings: Array) -> list[_Placed]:
            rows = zip(places.reshape(-1, 2), speeds, headings, strict=True)
            return [(*one, RobotState(*place, *rest)) for one, (place, *rest) in zip(new, rows, strict=True)]

        def fit(places: Float[Array, " size"]) -> Flag:
            nothing = jnp.zeros(len(new))
            everyone = [*placed, *robots(places, nothing, nothing)]
            count = len(placed)
            found = [self.fits(arena, everyone[one], everyone[:one]) for one in range(count, len(everyone))]
            return functools.reduce(operator.and_, found)

        places = _draw_until(fit, position_key, arena, len(new))
        headings = jax.random.uniform(heading_key, (len(new),), minval=-jnp.pi, maxval=jnp.pi)
        return robots(places, self._speeds(speed_key, [body for _, body in new]), headings)

    def fits(self, arena: Arena, one: _Placed, others: Sequence[_Placed]) -> Flag:
        """Return whether a robot is far enough from obstacles, from the others and, an evader, from a territory."""
        role, body, here = one
        found = arena.clearance(here.x, here.y) >= self.clearance + body.radius
        for side, other, there in others:
            least = self.clearance + body.radius + other.radius if side == role else self.separation
            found &= jnp.hypot(here.x - there.x, here.y - there.y) >= least
        if role == Role.EVADER and (goal := arena.territory):
            found &= jnp.hypot(here.x - goal.x, here.y - goal.y) >= goal.radius + self.separation
        return found

    def _speeds(self, key: PRNGKeyArray, bodies: Sequence[Unicycle]) -> Float[Array, " robots"]:
        if self.speed == "rest":
            return jnp.array([jnp.maximum(body.v_min, 0.0) for body in bodies], jnp.float32)
        low = jnp.array([body.v_min for body in bodies], jnp.float32)
        high = jnp.array([body.v_max for body in bodies], jnp.float32)
        return jax.random.uniform(key, (len(bodies),), minval=low, maxval=high)


def _draw_until(
    fits: Callable[[Float[Array, " size"]], Flag], key: PRNGKeyArray, arena: Arena, robots: int
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
