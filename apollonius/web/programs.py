"""The functions that the page runs: the rules, what robots see, and what players make of it.

Each is an ordinary JAX function of the package's own parts, which `apollonius.export` translates. How many robots,
obstacles, cells and units there are is data, so that one program serves every game and agent of the page.
"""

import functools
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.agents.chasing import Intercept, PurePursuit
from apollonius.agents.classical import AbstractClassical
from apollonius.agents.fleeing import Flee, FleeAware
from apollonius.agents.guarding import Territory
from apollonius.agents.network import MOST_LAYERS, MOST_WIDTH
from apollonius.agents.shield import MARGIN, Backup
from apollonius.agents.surrounding import Encirclement, VoronoiPursuit
from apollonius.export.c import Program
from apollonius.export.translate import translated
from apollonius.game.arena import Disc
from apollonius.game.by_side import BySide
from apollonius.game.chart import SIDE, STOPS, Chart
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Edge
from apollonius.game.teams import Teams
from apollonius.game.types import GameState, RobotState, Scalar
from apollonius.game.validation import MOST_DISCS, MOST_EDGES
from apollonius.observe.registry import find_observation
from apollonius.web.handed import Field, Floor, Robots
from apollonius.web.site import READS, ROBOTS

T = TypeVar("T")
UNITS = 64
"""Units of a layer that are worked out together: weights lie so in memory."""
Gears = Float[Array, "2"]
_ENDLESS = 2**28
"""Length of arrays of which the page has as much as is needed."""


# ---- rules


def step(
    robots: Robots,
    floor: Floor,
    field: Field,
    gears: Float[Array, "robots 2"],
    capture_distance: Scalar,
    dt: Scalar,
    left: Int[Array, ""],
    *,
    mates_collide: bool = False,
) -> dict[str, Any]:
    """Return the robots after a step, pursuers first, and how the game stands.

    Args:
        left: how many steps there may still be.
    """
    (first, *pursuers), (other, *evaders) = (robots.side(robots.bodies, second) for second in (False, True))
    teams = Teams(tuple(pursuers), tuple(evaders), mates_collide)
    game = Game(first, other, floor.arena(field), capture_distance, dt, left, teams=teams)

    def both(values: Any) -> BySide[tuple[Any, ...]]:
        return BySide(robots.side(values, False), robots.side(values, True))

    before = GameState(both(robots.states), jnp.zeros((), jnp.int32), status=both(robots.status))
    after = game.step(before, list(gears[:ROBOTS]), list(gears[ROBOTS:]))
    states = jax.tree.map(lambda *leaves: jnp.stack(leaves), *after.state.robots.pursuer, *after.state.robots.evader)
    assert after.state.status is not None
    status = jnp.stack([*after.state.status.pursuer, *after.state.status.evader])
    return {"states": states, "status": status, "outcome": after.outcome}


def move(body: Unicycle, robot: RobotState, gears: Gears, dt: Scalar) -> RobotState:
    """Return a robot after it has held an action."""
    return body.move(robot, *body.controls(gears), dt)


def clearance(floor: Floor, field: Field, x: Scalar, y: Scalar) -> Scalar:
    """Return how far a place is from walls and obstacles [m]."""
    return floor.arena(field).clearance(x, y)


def clearance_along(floor: Floor, field: Field, robot: RobotState, end: RobotState) -> Scalar:
    """Return the least clearance on the segment between two states [m]."""
    return floor.arena(field).clearance_along(robot, end)


# ---- what robots see, and what players do


def _observation(name: str) -> Callable[..., Float[Array, " size"]]:
    def observe(robots: Robots, floor: Floor, field: Field, chart: Chart, capture_distance: Scalar) -> Array:
        return find_observation(name)(robots.seen(floor.arena(field, chart), capture_distance))

    return observe


def _rule(player: Callable[[Scalar], AbstractClassical]) -> Callable[..., Float[Array, "9"]]:
    def values(robots: Robots, floor: Floor, field: Field, chart: Chart, capture_distance: Scalar, dt: Scalar) -> Array:
        return player(dt).values(robots.seen(floor.arena(field, chart), capture_distance))

    return values


def network(
    weights: Float[Array, " weights"],
    sizes: Int[Array, " layers"],
    count: Int[Array, ""],
    inputs: Float[Array, " inputs"],
) -> Float[Array, " outputs"]:
    """Return what fully connected layers with ReLU between them say.

    Args:
        weights: of each layer, for every `UNITS` of its units their biases and then, input by input, their weights.
        sizes: how many numbers go into each layer; at last how many come out.
        count: of layers.
    """

    def layer(number: Int[Array, ""], carry: tuple[Array, Array]) -> tuple[Array, Array]:
        at, hidden = carry
        block = (sizes[number] + 1) * UNITS
        blocks = (sizes[number + 1] + UNITS - 1) // UNITS

        def some(which: Int[Array, ""], after: Array) -> Array:
            start = at + which * block

            def add(place: Int[Array, ""], total: Array) -> Array:
                return total + hidden[place] * jax.lax.dynamic_slice(weights, (start + (place + 1) * UNITS,), (UNITS,))

            biases = jax.lax.dynamic_slice(weights, (start,), (UNITS,))
            total = jax.lax.fori_loop(0, sizes[number], add, biases)
            total = jnp.where(number == count - 1, total, jax.nn.relu(total))
            return jax.lax.dynamic_update_slice(after, total, (which * UNITS,))

        return at + blocks * block, jax.lax.fori_loop(0, blocks, some, jnp.zeros_like(hidden))

    return jax.lax.fori_loop(0, count, layer, (jnp.zeros((), jnp.int32), inputs))[1][:UNITS]


class _FleeAware(FleeAware):
    """Looks ahead for any number of steps."""

    steps: int | Array = 0


class _Backup(Backup):
    """Manoeuvres of any number of steps."""

    steps: int | Array  # pyright: ignore[reportIncompatibleVariableOverride]


def room_after(body: Unicycle, robot: RobotState, gears: Gears, dt: Scalar, floor: Floor, field: Field) -> Scalar:
    """Return how much room an action and the best way to rest after it leave [m].

    It is less than that, but more than `MARGIN`, where nothing is as near as the robot can come on any way to rest.
    """
    arena = floor.arena(field)
    backup = _Backup(arena, body, dt, jnp.ceil(body.v_max / (body.u1_max * dt)).astype(jnp.int32))
    after = move(body, robot, gears, dt)
    longest = after.v**2 / (2 * body.u1_max) + after.v * dt
    least = jnp.minimum(arena.clearance_along(robot, after), arena.clearance(after.x, after.y) - longest) - body.radius
    is_enough = (least > MARGIN) & (body.v_min >= 0) & (floor.counts[3] == 0)
    return jax.lax.cond(is_enough, lambda: least, lambda: backup.room_after(robot, gears))


def places(chart: Chart, x: Scalar, y: Scalar) -> dict[str, Array]:
    """Return the stops around a point and their weights."""
    stops, weights = chart.places(x, y)
    return {"stops": stops, "weights": weights}


# ---- all of them

_RULES: dict[str, Callable[[Scalar], AbstractClassical]] = {
    "pure_pursuit": PurePursuit,
    "intercept": Intercept,
    "flee": Flee,
    "flee_aware": lambda dt: _FleeAware(dt, jnp.ceil(4 / dt).astype(jnp.int32)),
    "guard": lambda dt: Territory(dt, guards=True),
    "reach": lambda dt: Territory(dt, guards=False),
    "voronoi_pursuit": VoronoiPursuit,
    "encirclement": Encirclement,
}


def page_programs() -> Iterator[Program]:
    """Yield all programs of the page."""

    def made(function: Callable[..., Any], *given: Any, name: str | None = None) -> Program:
        with jax.numpy_dtype_promotion("standard"):  # numbers that are Python's elsewhere are data here
            return translated(function, *given, name=name or function.__name__, whole=True)

    shapes = jax.eval_shape(_examples)
    body, robot, robots, floor, field, chart = (
        shapes[name] for name in ("body", "robot", "robots", "floor", "field", "chart")
    )
    real, whole, pair = (shapes[name] for name in ("real", "whole", "pair"))
    stepping = robots, floor, field, shapes["gears"], real, real, whole
    yield made(step, *stepping)
    yield made(functools.partial(step, mates_collide=True), *stepping, name="step_of_bodies")
    yield made(move, body, robot, pair, real)
    yield made(clearance, floor, field, real, real)
    yield made(clearance_along, floor, field, robot, robot)
    yield made(room_after, body, robot, pair, real, floor, field)
    yield made(places, chart, real, real)
    yield made(network, shapes["weights"], shapes["sizes"], whole, shapes["inputs"])
    for name in READS:
        yield made(_observation(name), robots, floor, field, chart, real, name=f"see_{name}")
    for name, player in _RULES.items():
        yield made(_rule(player), robots, floor, field, chart, real, real, name=name)


def _examples() -> dict[str, Any]:
    """Return arguments of the shapes that the page has."""

    def real(*shape: int) -> Array:
        return jnp.zeros(shape, jnp.float32)

    def whole(*shape: int) -> Array:
        return jnp.zeros(shape, jnp.int32)

    def several(count: int, tree: T) -> T:
        return jax.tree.map(lambda leaf: jnp.zeros((count, *leaf.shape), leaf.dtype), tree)

    number, many = real(), 2 * ROBOTS
    body, robot = Unicycle(number, number, number, number, number), RobotState(number, number, number, number)
    disc, edge = Disc(number, number, number), Edge(number, number, number, number, whole())
    lengths, beside = jnp.zeros((1, STOPS**2, STOPS**2), jnp.uint16), jnp.zeros((1, SIDE, SIDE), jnp.uint16)
    return {
        "body": body,
        "robot": robot,
        "robots": Robots(several(many, body), several(many, robot), whole(many)),
        "floor": Floor(real(4), disc, several(MOST_DISCS, disc), several(MOST_EDGES, edge), real(3), whole(4)),
        "field": real(_ENDLESS),
        "chart": Chart(real(1, SIDE + 1, SIDE + 1), lengths, beside, real(1), real(1), real(1), whole()),
        "gears": real(many, 2),
        "weights": real(_ENDLESS),
        "sizes": whole(MOST_LAYERS + 2),
        "inputs": real(MOST_WIDTH),
        "pair": real(2),
        "real": real(),
        "whole": whole(),
    }
