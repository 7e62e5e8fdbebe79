"""The distributions of initial states."""

import functools
import operator
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.types import ROLES, BySide, Flag, GameState, Real, RobotState, Role
from apollonius.io.errors import require

_Robot = tuple[Role, Unicycle, RobotState]
"""A robot of a side in its place."""


class Starts(eqx.Module):
    """The distribution of starts: robots uniform in the free space, apart from each other, headings
    uniform.

    Attributes:
        speed: `rest` (v = 0, or the robot's lowest) or `moving` (v uniform between the robot's
            limits; from some of these starts a crash is certain).
        clearance: least distance of a robot's body from walls, obstacles and the bodies of its
            mates [m].
        separation: least distance between the centres of opponents, and of evaders from a territory
            [m].
    """

    speed: Literal["rest", "moving"] = eqx.field(static=True, default="rest")
    clearance: Real = 0.3
    separation: Real = 1.0

    def check(self, capture_distance: Real) -> None:
        """Refuse impossible names and numbers."""
        require(self.speed in ("rest", "moving"), "starts.speed", self.speed, "rest or moving")
        require(self.clearance >= 0, "starts.clearance", self.clearance, "0 m or more")
        bound = f"at least capture_distance = {capture_distance} m"
        require(
            self.separation >= capture_distance,
            "starts.separation",
            self.separation,
            f"{bound}, or games would be over before they begin",
        )

    def sample(
        self, key: PRNGKeyArray, arena: Arena, bodies: BySide[tuple[Unicycle, ...]]
    ) -> GameState:
        """Draw an initial state. The key is consumed.

        The positions of both sides' first robots are drawn together, again until they fit, so the
        distribution is exactly uniform over the pairs that fit; then their mates', one by one, each
        uniform in the space that is left.
        """
        mates = [[(role, body)] for role in ROLES for body in bodies[role][1:]]
        keys = jax.random.split(key, 3 + len(mates))
        robots = self._draw([*keys[:3]], arena, [(role, bodies[role][0]) for role in ROLES], [])
        for mate, mate_key in zip(mates, keys[3:], strict=True):
            robots += self._draw([*jax.random.split(mate_key, 3)], arena, mate, robots)
        return GameState.at_start(
            ROLES.map(lambda role: tuple(robot for side, _, robot in robots if side == role))
        )

    def _draw(
        self,
        keys: Sequence[PRNGKeyArray],
        arena: Arena,
        new: Sequence[tuple[Role, Unicycle]],
        placed: Sequence[_Robot],
    ) -> list[_Robot]:
        """Draw new robots together, beside those already placed. The three keys are consumed."""
        position_key, heading_key, speed_key = keys

        def robots(places: Array, speeds: Array, headings: Array) -> list[_Robot]:
            rows = zip(places.reshape(-1, 2), speeds, headings, strict=True)
            return [
                (role, body, RobotState(*position, *motion))
                for (role, body), (position, *motion) in zip(new, rows, strict=True)
            ]

        def fit(places: Float[Array, " size"], matters: Flag) -> Flag:
            nothing = jnp.zeros(len(new))
            everyone = [*placed, *robots(places, nothing, nothing)]
            count = len(placed)
            numbers = range(count, len(everyone))
            fit_flags = [self.fits(arena, everyone[i], everyone[:i], matters) for i in numbers]
            return functools.reduce(operator.and_, fit_flags)

        places = draw_until(fit, position_key, arena, len(new))
        headings = jax.random.uniform(heading_key, (len(new),), minval=-jnp.pi, maxval=jnp.pi)
        return robots(places, self._speeds(speed_key, [body for _, body in new]), headings)

    def fits(
        self, arena: Arena, robot: _Robot, placed: Sequence[_Robot], matters: Flag | bool = True
    ) -> Flag:
        """Check whether a robot keeps its distances from obstacles, other robots and a territory.

        Only evaders keep away from a territory. Where it does not matter, the answer may be wrong.
        """
        role, body, state = robot
        is_free = arena.is_clear(state.x, state.y, self.clearance + body.radius, matters)
        for side, other, other_state in placed:
            min_distance = self.separation
            if side == role:
                min_distance = self.clearance + body.radius + other.radius
            is_free &= jnp.hypot(state.x - other_state.x, state.y - other_state.y) >= min_distance
        goal = arena.territory
        if role == Role.EVADER and goal:
            distance = jnp.hypot(state.x - goal.x, state.y - goal.y)
            is_free &= distance >= goal.radius + self.separation
        return is_free

    def _speeds(self, key: PRNGKeyArray, bodies: Sequence[Unicycle]) -> Float[Array, " robots"]:
        if self.speed == "rest":
            return jnp.array([jnp.maximum(body.v_min, 0.0) for body in bodies], jnp.float32)
        low = jnp.array([body.v_min for body in bodies], jnp.float32)
        high = jnp.array([body.v_max for body in bodies], jnp.float32)
        return jax.random.uniform(key, (len(bodies),), minval=low, maxval=high)


class _Search(NamedTuple):
    """A search for places that fit: the next key, the last places, and whether they fit."""

    key: PRNGKeyArray
    places: Float[Array, " size"]
    fit: Flag


def draw_until(
    fits: Callable[[Float[Array, " size"], Flag], Flag],
    key: PRNGKeyArray,
    arena: Arena,
    robots: int,
) -> Float[Array, " size"]:
    """Draw x and y of some robots uniformly in an arena until they fit. The key is consumed.

    Args:
        fits: checks places; where its second argument is false, the answer does not matter.
        key: draws the places.
        arena: where they lie.
        robots: the number of robots.
    """
    low = jnp.array([arena.x_min, arena.y_min] * robots, jnp.float32)
    high = jnp.array([arena.x_max, arena.y_max] * robots, jnp.float32)

    def draw(draw_key: PRNGKeyArray) -> Float[Array, " size"]:
        return jax.random.uniform(draw_key, low.shape, minval=low, maxval=high)

    def redraw(search: _Search) -> _Search:
        next_key, draw_key = jax.random.split(search.key)
        places = draw(draw_key)
        # Of many searches together those that are over go on in vain.
        return _Search(next_key, places, fits(places, ~search.fit))

    first_key, retry_key = jax.random.split(key)
    places = draw(first_key)
    first = _Search(retry_key, places, fits(places, jnp.ones((), bool)))
    return jax.lax.while_loop(lambda search: ~search.fit, redraw, first).places
