"""Checks that a game, its robots and its kinds of obstacles can be played, saved and exported."""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from apollonius.arenas.file import as_game, from_dict, to_dict
from apollonius.conformance.defects import require_all, require_pure, require_rows
from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game, reset_batch
from apollonius.game.obstacle import AbstractObstacle
from apollonius.game.types import NUM_ACTIONS, ROLES, GameState, RobotState
from apollonius.io.errors import require
from jaxpr2c.translator import translate

Segments = Float[np.ndarray, " segments"]

_OF_KIND = 2
"""Obstacles of a kind that are checked."""
_STATES = 200
_SEGMENTS = 400
_SAMPLES = 201
"""Points of a segment at which clearances are compared."""
_RADIUS = 0.3
"""Of the body [m] whose contacts are checked."""
_EXACT, _ROUGH = 0.01, 0.25
"""Largest errors of a clearance along a segment [m]: too long, and too short."""
_STEEP = 1.5
"""By how much a clearance may change in a metre: a distance by 1 at most, in the cells of a map by
1.42.
"""
_ON_EDGE = 0.05
"""Largest distance of the corners of an outline from the obstacle's edge [m]."""


def check_game(game: Game | str) -> None:
    """Check that a game in one arena, its robots and its kinds of obstacles can be played, saved
    and exported.

    Its step must be pure, compile, and give the same in a batch as alone; starts must be free; an
    obstacle's clearance must be a distance, its contacts swept, its outline on its edge; robots
    must keep their limits; a file must hold it.

    Raises:
        apollonius.conformance.defects.Nonconformance: with a line for each property that it lacks.
        InvalidInput: for a game that cannot be.
    """
    rules = as_game(game)
    rules.require_one_arena("check_game")
    properties = {"file": lambda: _check_file(rules), "export": lambda: _check_export(rules.arena)}
    of_kind: dict[type, int] = {}
    for name, obstacle in rules.arena.named_obstacles.items():
        of_kind[type(obstacle)] = of_kind.get(type(obstacle), 0) + 1
        if of_kind[type(obstacle)] <= _OF_KIND:
            properties[name] = lambda obstacle=obstacle: _check_obstacle(obstacle, rules.arena)
    for side, bodies in zip(("pursuer", "evader"), rules.bodies, strict=True):
        properties[side] = lambda body=bodies[0]: _check_body(body, rules)
    require_all(
        "the game",
        properties | {"steps": lambda: _check_steps(rules), "starts": lambda: _check_starts(rules)},
    )


def _check_file(game: Game) -> None:
    record = to_dict(game)
    again = to_dict(from_dict(type(game), record, "its own record"))
    changed = sorted(key for key in record if again.get(key) != record[key])
    require(
        not changed,
        "record",
        ", ".join(changed),
        "the same once it is read again: make its numbers fields",
    )


def _check_export(arena: Arena) -> None:
    robot = RobotState(*jnp.zeros(4))

    def queries(arena: Arena, before: RobotState, after: RobotState) -> dict[str, jax.Array]:
        along, hit = (
            arena.clearance_along(before, after),
            arena.hits_obstacle(before, after, _RADIUS),
        )
        return {"along": along, "hit": hit, "hidden": arena.hides(before, after)}

    translate(queries, arena, robot, robot, name="arena")


def _check_obstacle(obstacle: AbstractObstacle, arena: Arena) -> None:
    """Refuse an obstacle that is not as far away, at points and along segments, as its own
    clearances say.
    """
    _check_form(obstacle)
    starts, ends = _segments(arena)
    shares = np.linspace(0, 1, _SAMPLES)[:, None, None]
    points = starts * (1 - shares) + ends * shares
    spacing = np.hypot(*(ends - starts).T) / (_SAMPLES - 1)
    least = _check_clearances(obstacle, points, spacing)
    segments = _robots(starts), _robots(ends)
    eighth = _eighth(spacing)
    _check_along(obstacle, segments, least, spacing)
    contacts = jax.vmap(lambda before, after: obstacle.is_hit(before, after, _RADIUS))(*segments)
    _check_contacts("is_hit", contacts, least - _RADIUS, spacing + eighth)
    hidden = jax.vmap(obstacle.hides)(*segments)
    _check_contacts("hides", hidden, least, spacing + eighth + _ROUGH)
    _check_outline(obstacle)


def _check_form(obstacle: AbstractObstacle) -> None:
    """Refuse an obstacle without numbers, and one whose clearance at a point is no number."""
    numbers = jax.tree.leaves(obstacle)
    bound = "a class whose numbers are fields, without static"
    require(numbers, type(obstacle).__name__, "without numbers", bound)
    center = jnp.zeros(())
    form = jax.eval_shape(obstacle.clearance, center, center)
    is_number = form.shape == () and form.dtype == jnp.float32
    shown_form = f"{form.dtype} {list(form.shape)}"
    require(is_number, "clearance", shown_form, "float32 []: one number for one point")


def _check_clearances(
    obstacle: AbstractObstacle, points: Float[np.ndarray, "samples segments 2"], spacing: Segments
) -> Segments:
    """Refuse clearances that are no distances; return the least of each segment [m].

    Args:
        obstacle: the obstacle.
        points: points along segments [m].
        spacing: distances between two points of each segment [m].
    """
    clearance = jax.jit(jax.vmap(jax.vmap(obstacle.clearance)))
    clearances = np.asarray(clearance(*_coordinates(points)), float)
    require(np.isfinite(clearances).all(), "clearance", "NaN or infinite", "finite everywhere")
    steepness = (np.abs(np.diff(clearances, axis=0)) / np.maximum(spacing, 1e-3)).max()
    bound = (
        f"a distance in metres, which changes by 1 m at most: {type(obstacle).__name__}.clearance"
    )
    change = f"one that changes by {steepness:.3g} m in a metre"
    require(steepness <= _STEEP, "clearance", change, bound)
    return clearances.min(axis=0)


def _eighth(spacing: Segments) -> Segments:
    """Return an eighth of segments' lengths, what `AbstractObstacle.clearance_along` allows
    itself.
    """
    return spacing * (_SAMPLES - 1) / 8


def _check_along(
    obstacle: AbstractObstacle,
    segments: tuple[RobotState, RobotState],
    least: Segments,
    spacing: Segments,
) -> None:
    """Refuse clearances along segments that disagree with the least ones of their points [m].

    Args:
        obstacle: the obstacle.
        segments: robots at both ends.
        least: the least clearances [m].
        spacing: distances between two of the points of each segment [m].
    """
    along = np.asarray(require_rows(obstacle.clearance_along, segments, _EXACT), float)
    outside = np.maximum(least, 0)  # inside, any negative number will do
    longer = (along - outside).max()
    bound = "at most the least clearance of its points: a quick robot would pass through"
    require(longer <= _EXACT, "clearance_along", f"{longer:.3g} m more than that", bound)
    shorter = (outside - along - spacing - _eighth(spacing))[least > 0].max(initial=0)
    bound = "the least clearance of a segment's points, as near as it can be"
    require(shorter <= _ROUGH, "clearance_along", f"{shorter:.3g} m less than that", bound)


def _check_outline(obstacle: AbstractObstacle) -> None:
    """Refuse an outline with a corner that is not on the obstacle's edge."""
    corners = obstacle.outline()
    if corners:
        coordinates = _coordinates(np.asarray(corners, float))
        away = np.abs(np.asarray(jax.vmap(obstacle.clearance)(*coordinates))).max()
        bound = f"within {_ON_EDGE} m of its edge, where its clearance is 0"
        require(away <= _ON_EDGE, "outline", f"a corner {away:.3g} m away", bound)


def _check_contacts(
    name: str, contacts: Bool[Array, " segments"], least: Segments, slack: Segments
) -> None:
    """Refuse contacts that disagree with the least clearances of segments [m] by more than some
    slack [m].
    """
    missed = (~np.asarray(contacts) & (least < -_ROUGH)).sum()
    bound = "true wherever a segment comes nearer than the radius: look at the whole segment"
    require(not missed, name, f"false on {missed} of {_SEGMENTS} segments that touch it", bound)
    invented = (np.asarray(contacts) & (least > slack + _ROUGH)).sum()
    bound = "false where no point of the segment is near"
    require(
        not invented,
        name,
        f"true on {invented} of {_SEGMENTS} segments that are far from it",
        bound,
    )


def _check_body(body: Unicycle, game: Game) -> None:
    """Refuse a robot that leaves its limits, or whose heading is not wrapped."""
    rng = np.random.default_rng(0)
    speeds = rng.uniform(body.v_min, body.v_max, _STATES)
    numbers = [*rng.uniform(0, 1, (2, _STATES)), speeds, rng.uniform(-math.pi, math.pi, _STATES)]
    robots = jax.vmap(RobotState)(*(jnp.asarray(number, jnp.float32) for number in numbers))

    def move(robot: RobotState, action: jax.Array) -> RobotState:
        return body.move(robot, *body.controls(action), game.dt)

    rows = robots, jnp.asarray(rng.integers(0, NUM_ACTIONS, _STATES), jnp.int32)
    after = jax.tree.map(np.asarray, require_rows(move, rows, 1e-3))
    is_finite = all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(after))
    require(is_finite, "move", "NaN or infinite", "finite for every action")
    in_limits = (after.v >= body.v_min - 1e-4).all() and (after.v <= body.v_max + 1e-4).all()
    bound = f"from v_min = {body.v_min} to v_max = {body.v_max} m/s: clip it in move"
    require(in_limits, "speed after move", f"{after.v.min():.3g} to {after.v.max():.3g}", bound)
    turned = np.abs(after.heading).max()
    require(
        turned <= math.pi + 1e-4,
        "heading after move",
        f"{turned:.3g}",
        "wrapped to [-pi, pi]: wrap_angle",
    )


def _check_steps(game: Game) -> None:
    """Refuse steps that are impure, or others in a batch than alone."""
    rng = np.random.default_rng(0)
    states = reset_batch(game, jax.random.key(0), _STATES)
    actions = [
        tuple(jnp.asarray(rng.integers(0, NUM_ACTIONS, _STATES), jnp.int32) for _ in bodies)
        for bodies in game.bodies
    ]
    first = jax.tree.map(lambda leaf: leaf[0], (states, *actions))
    require_pure(game.step, *first)
    after = require_rows(game.step, (states, *actions), 1e-3)
    is_finite = all(
        np.isfinite(leaf).all() for leaf in jax.tree.leaves((after.state.robots, after.rewards))
    )
    require(is_finite, "states and rewards", "NaN or infinite", "finite after every step")


def _check_starts(game: Game) -> None:
    """Refuse starts that are not free."""
    states: GameState = reset_batch(game, jax.random.key(1), _STATES)
    clearance = jax.jit(jax.vmap(game.arena.clearance))
    for role in ROLES:
        for body, robots in zip(game.bodies[role], states.robots[role], strict=True):
            left = float(clearance(robots.x, robots.y).min()) - body.radius - game.starts.clearance
            bound = (
                f"at least {game.starts.clearance} m, as starts.clearance is: see Arena.clearance"
            )
            require(
                left >= -1e-3,
                "clearance of a start",
                f"{left + game.starts.clearance:.3g} m",
                bound,
            )


def _segments(
    arena: Arena,
) -> tuple[Float[np.ndarray, "segments 2"], Float[np.ndarray, "segments 2"]]:
    """Return the ends of segments in an arena [m], every second one as short as a step."""
    rng = np.random.default_rng(0)
    low, high = np.array([arena.x_min, arena.y_min]), np.array([arena.x_max, arena.y_max])
    starts, ends = rng.uniform(low, high, (2, _SEGMENTS, 2))
    ends[::2] = np.clip(starts[::2] + rng.uniform(-0.2, 0.2, (len(ends[::2]), 2)), low, high)
    return starts, ends


def _coordinates(points: Float[np.ndarray, "*points 2"]) -> tuple[jax.Array, jax.Array]:
    return jnp.asarray(points[..., 0], jnp.float32), jnp.asarray(points[..., 1], jnp.float32)


def _robots(points: Float[np.ndarray, "*points 2"]) -> RobotState:
    """Return robots at rest at some points."""
    return jax.vmap(lambda x, y: RobotState(x, y, jnp.zeros(()), jnp.zeros(())))(
        *_coordinates(points)
    )
