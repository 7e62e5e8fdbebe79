"""The functions that the page runs: the rules, charts, observations, and players.

Each is an ordinary JAX function of the package's own parts, which `apollonius.export` translates. The numbers of
robots, obstacles, cells and units are data, so that one program serves every game and agent of the page.
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
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.shield import MARGIN, Backup
from apollonius.agents.surrounding import Encirclement, VoronoiPursuit
from apollonius.arenas.charting import clearances, paths
from apollonius.export.program import Program
from apollonius.export.translate import translated
from apollonius.game.arena import MOST_DISCS, MOST_EDGES, Disc
from apollonius.game.by_side import BySide
from apollonius.game.chart import SIDE, STOPS, Chart
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.polygon import Edge
from apollonius.game.teams import Teams
from apollonius.game.types import GameState, RobotState, Scalar
from apollonius.io.errors import require
from apollonius.observe.registry import find_observation
from apollonius.web.handed import Field, Floor, Robots
from apollonius.web.site import READS, ROBOTS

T = TypeVar("T")
UNITS = 64
"""Units of a layer whose weights lie together in memory."""
Gears = Float[Array, "2"]
_ENDLESS = 2**28
"""Length of arrays that the page makes as long as it needs."""


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
    """Return the robots after a step, pursuers first, and the outcome.

    Args:
        left: steps until the time limit.
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
    """Return the clearance of a point [m]."""
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
    """Return the outputs of fully connected layers with ReLU between them.

    Args:
        weights: of each layer, for every `UNITS` units their biases and then, input by input, their weights.
        sizes: numbers of inputs of each layer, and of outputs of the last one.
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
    """A player that looks ahead for any number of steps."""

    steps: int | Array = 0


class _Backup(Backup):
    """Manoeuvres of any number of steps."""

    steps: int | Array  # pyright: ignore[reportIncompatibleVariableOverride]


def room_after(body: Unicycle, robot: RobotState, gears: Gears, dt: Scalar, floor: Floor, field: Field) -> Scalar:
    """Return the least clearance during an action and the best manoeuvre to rest after it [m].

    It is less, but more than `MARGIN`, where nothing is within reach of any manoeuvre to rest.
    """
    arena = floor.arena(field)
    backup = _Backup(arena, body, dt, jnp.ceil(body.v_max / (body.u1_max * dt)).astype(jnp.int32))
    after = move(body, robot, gears, dt)
    longest = after.v**2 / (2 * body.u1_max) + after.v * dt
    least = jnp.minimum(arena.clearance_along(robot, after), arena.clearance(after.x, after.y) - longest) - body.radius
    is_enough = (least > MARGIN) & (body.v_min >= 0) & (floor.counts[3] == 0)
    return jax.lax.cond(is_enough, lambda: least, lambda: backup.room_after(robot, gears))


def chart(
    floor: Floor, field: Field, corners: Float[Array, "2 corners"], side: Scalar, radius: Scalar
) -> dict[str, Chart]:
    """Return the chart of an arena.

    Args:
        corners: x and y [m] of the corners of the chart's cells.
        side: length of the arena's longer side [m].
        radius: of the body that follows its paths [m].
    """
    found = clearances(floor.arena(field), corners[0], corners[1])
    ways, beside = paths(found, side, radius)
    x, y = corners[:, :1]
    return {"chart": Chart(found[None], ways[None], beside[None], x, y, side[None], jnp.zeros((), jnp.int32))}


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


def _made(function: Callable[..., Any], *given: Any, name: str | None = None) -> Program:
    with jax.numpy_dtype_promotion("standard"):  # numbers that are Python's elsewhere are data here
        return translated(function, *given, name=name or function.__name__, whole=True)


def player_program(player: AbstractPolicy) -> Program:
    """Return a player of a user's own as the page calls it, from all that a robot sees to its action.

    Raises:
        InvalidInput: for a player with a memory or with continuous actions.
    """
    plays = not jax.tree.leaves(player.memory) and not player.continuous
    require(
        plays, "player", type(player).__name__, "one with discrete actions and without a memory, to play in the page"
    )

    def own(
        robots: Robots, floor: Floor, field: Field, chart: Chart, capture_distance: Scalar, dt: Scalar
    ) -> Int[Array, ""]:
        seen = robots.seen(floor.arena(field, chart), capture_distance)
        return jnp.asarray(player(player.observation(seen), (), jnp.uint32(0))[0], jnp.int32)

    shapes = jax.eval_shape(_examples)
    return _made(own, *(shapes[name] for name in ("robots", "floor", "field", "chart", "real", "real")))


def page_programs() -> Iterator[Program]:
    """Yield all programs of the page."""

    shapes = jax.eval_shape(_examples)
    body, robot, robots, floor, field, drawn = (
        shapes[name] for name in ("body", "robot", "robots", "floor", "field", "chart")
    )
    real, whole, pair = (shapes[name] for name in ("real", "whole", "pair"))
    stepping = robots, floor, field, shapes["gears"], real, real, whole
    yield _made(step, *stepping)
    yield _made(functools.partial(step, mates_collide=True), *stepping, name="step_of_bodies")
    yield _made(move, body, robot, pair, real)
    yield _made(clearance, floor, field, real, real)
    yield _made(clearance_along, floor, field, robot, robot)
    yield _made(room_after, body, robot, pair, real, floor, field)
    yield _made(chart, floor, field, shapes["corners"], real, real)
    yield _made(places, drawn, real, real)
    yield _made(network, shapes["weights"], shapes["sizes"], whole, shapes["inputs"])
    for name in READS:
        yield _made(_observation(name), robots, floor, field, drawn, real, name=f"see_{name}")
    for name, player in _RULES.items():
        yield _made(_rule(player), robots, floor, field, drawn, real, real, name=name)


def _examples() -> dict[str, Any]:
    """Return arguments of the page's shapes."""

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
        "corners": real(2, SIDE + 1),
        "gears": real(many, 2),
        "weights": real(_ENDLESS),
        "sizes": whole(MOST_LAYERS + 2),
        "inputs": real(MOST_WIDTH),
        "pair": real(2),
        "real": real(),
        "whole": whole(),
    }
