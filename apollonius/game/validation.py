"""What makes a game impossible to play, said with the value, the bound and the remedy."""

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from jaxtyping import Float

from apollonius.io.errors import InvalidInput, require
from apollonius.io.limits import DISCS, ROBOTS

if TYPE_CHECKING:
    from apollonius.game.arena import Arena
    from apollonius.game.dynamics import Unicycle
    from apollonius.game.game import Game

MAX_TURN = 2.0
"""Largest turn in one step [rad]: a step is one arc, and beyond this its contacts would not be those of its chord."""
MAX_SIZE = 1e6
"""Largest size of any number of a game: in single precision the places of a larger arena would be decimetres apart."""
MAX_STEPS = 2**31 - 1
"""Largest time limit [steps]: steps are counted in 32 bits."""
_DRAWS = 100_000
"""Pairs of places at which free space is looked for; a start rarer than that would take for ever to draw."""
_SIDES = ("pursuer", "evader")
_PLACINGS = 100
"""Starts of teams that are tried out."""
_TOGETHER = 5_000
"""Pairs that are looked at together; in most arenas the first few have room enough."""
MOST_EDGES = 2_000
"""Most corners of all polygons together."""
MOST_POLYGONS = 200
"""Most polygons: each takes some time to compile."""
MOST_ROBOTS = ROBOTS.most
"""Most robots of a side."""
MOST_DISCS = DISCS.most
"""Most discs: with this many, a game takes half a minute to compile."""
FEWER = "draw so many obstacles as an occupancy map"
"""What to do instead of many obstacles."""


def require_single_precision() -> None:
    """Refuse to compute in double precision, in which no weights, tables and compilations are kept.

    Raises:
        InvalidInput: where JAX was told to.
    """
    double: Any = jax.config.jax_enable_x64  # pyright: ignore[reportAttributeAccessIssue]
    require(not double, "JAX_ENABLE_X64", double, "0: all here is in single precision; unset it")


_to_obstacles = jax.jit(jax.vmap(lambda arena, x, y: arena.to_obstacles(x, y), in_axes=(None, 0, 0)))


def check_game(game: "Game") -> None:
    """Raise InvalidInput unless a game with these numbers can be played.

    Games whose numbers are being traced or swept (arrays) are left unchecked: their values are not known here.
    """
    require_single_precision()
    if any(isinstance(leaf, (jax.Array, np.ndarray)) for _, leaf in _numbers(game)):
        return
    _check_finite(game)
    require(game.reward.profile in ("paper", "zero-sum"), "reward.profile", game.reward.profile, "paper or zero-sum")
    within = game.reward.zero_sum_within
    bound = "more than 0 m, or left out for everywhere"
    require(within is None or within > 0, "reward.zero_sum_within", within, bound)
    require(game.starts.speed in ("rest", "moving"), "starts.speed", game.starts.speed, "rest or moving")
    require(np.float32(game.dt) > 0, "dt", game.dt, "more than 0 s; the paper game uses 0.1")
    capture = game.capture_distance
    require(np.float32(capture) > 0, "capture_distance", capture, "more than 0 m; the paper uses 0.3")
    require(
        1 <= game.max_steps <= MAX_STEPS and game.max_steps == int(game.max_steps),
        "max_steps", game.max_steps, f"a whole number, at least 1, at most {MAX_STEPS}; the paper game uses 1000",
    )  # fmt: skip
    _check_teams(game)
    _check_arena(game)
    require(game.starts.clearance >= 0, "starts.clearance", game.starts.clearance, "0 m or more")
    require(
        game.starts.separation >= game.capture_distance,
        "starts.separation", game.starts.separation,
        f"at least capture_distance = {game.capture_distance} m, or games would be over before they begin",
    )  # fmt: skip
    _check_room(game)


def _numbers(game: "Game") -> list[tuple[str, Any]]:
    """All its numbers by name, but for a map's field of distances and what a game need not have."""
    leaves = jax.tree_util.tree_flatten_with_path(game, is_leaf=lambda leaf: leaf is None)[0]
    named = [(jax.tree_util.keystr(path, simple=True, separator="."), leaf) for path, leaf in leaves]
    optional = "arena.map", "arena.territory", "arena.chart", "scenario", "teams", "reward.zero_sum_within"
    left_out = {(name, True) for name in optional} | {("arena.map.field", False)}
    checked = [(name, leaf) for name, leaf in named if (name, leaf is None) not in left_out]
    return [(name, leaf) for name, leaf in checked if not name.startswith("arena.chart.")]


def _check_finite(game: "Game") -> None:
    for name, leaf in _numbers(game):
        is_number = isinstance(leaf, (int, float)) and not isinstance(leaf, bool)
        require(is_number and abs(leaf) < math.inf, name, leaf, "a finite number")
        require(abs(leaf) <= MAX_SIZE or name == "max_steps", name, leaf, f"within {MAX_SIZE:g} of 0")


def _check_teams(game: "Game") -> None:
    for side, bodies in zip(_SIDES, game.bodies, strict=True):
        require(len(bodies) <= MOST_ROBOTS, f"{side}s", len(bodies), f"at most {MOST_ROBOTS}")
        for number, body in enumerate(bodies):
            _check_robot(body, f"{side}s[{number}]" if len(bodies) > 1 else side, game.dt)


def _check_robot(body: "Unicycle", name: str, dt: Any) -> None:
    require(
        body.v_min <= body.v_max, f"{name}.v_min", body.v_min, f"at most v_max = {body.v_max} m/s; exchange the two"
    )
    require(body.v_max > 0, f"{name}.v_max", body.v_max, "more than 0 m/s, or the robot cannot go forward")
    require(body.u1_max >= 0, f"{name}.u1_max", body.u1_max, "0 m/s^2 or more; gears are -u1_max, 0, +u1_max")
    require(body.u2_max >= 0, f"{name}.u2_max", body.u2_max, "0 rad/s or more; gears are -u2_max, 0, +u2_max")
    bound = f"at most {MAX_TURN / dt:g} rad/s, {MAX_TURN} rad in a step of {dt:g} s; make it or dt smaller"
    require(body.u2_max * dt <= MAX_TURN, f"{name}.u2_max", body.u2_max, bound)
    require(body.radius >= 0, f"{name}.radius", body.radius, "0 m (a point) or more")


def _check_arena(game: "Game") -> None:
    arena = game.arena
    require(arena.x_min < arena.x_max, "arena.x_min", arena.x_min, f"less than x_max = {arena.x_max} m")
    require(arena.y_min < arena.y_max, "arena.y_min", arena.y_min, f"less than y_max = {arena.y_max} m")
    require(
        len(arena.discs) <= MOST_DISCS, "arena.discs", f"{len(arena.discs):,} of them", f"at most {MOST_DISCS}; {FEWER}"
    )
    polygons = len(arena.polygons)
    require(polygons <= MOST_POLYGONS, "arena.polygons", f"{polygons:,} of them", f"at most {MOST_POLYGONS}; {FEWER}")
    corners = sum(len(polygon.vertices) for polygon in arena.polygons)
    require(corners <= MOST_EDGES, "arena.polygons", f"{corners:,} corners", f"at most {MOST_EDGES} in all; {FEWER}")
    for field in fields(arena):
        several = getattr(arena, field.name)
        for index, obstacle in enumerate(several if isinstance(several, tuple) else ()):
            obstacle.check(f"arena.{field.name}[{index}]", arena)
    if arena.territory:
        goal, name = arena.territory, "arena.territory"
        require(goal.radius > 0, f"{name}.radius", goal.radius, "more than 0 m; remove it to have no territory")
        inside = arena.x_min <= goal.x <= arena.x_max and arena.y_min <= goal.y <= arena.y_max
        require(inside, f"{name} centre", (goal.x, goal.y), "inside the walls; move or remove it")
    if arena.map:
        found = arena.map
        covered = found.x <= arena.x_min and arena.x_max <= found.x_max
        covered &= found.y <= arena.y_min and arena.y_max <= found.y_max
        walls = f"[{arena.x_min}, {arena.x_max}] x [{arena.y_min}, {arena.y_max}] m"
        ends = f"[{found.x}, {found.x_max}] x [{found.y}, {found.y_max}] m"
        require(covered, "arena walls", walls, f"within the map's ends {ends}; leave them out to have just these")


def _check_room(game: "Game") -> None:
    """Two robots must find room to start, both at once and far enough apart, and their mates beside them."""
    arena, starts = game.arena, game.starts
    samples = np.random.default_rng(0).uniform(size=(4, _DRAWS))
    xs = np.asarray(arena.x_min + (arena.x_max - arena.x_min) * samples[:2])
    ys = np.asarray(arena.y_min + (arena.y_max - arena.y_min) * samples[2:])
    largest = [max(body.radius for body in side) for side in game.bodies]
    margins = {side: starts.clearance + radius for side, radius in zip(_SIDES, largest, strict=True)}
    fits, reach = np.zeros(2, bool), 0.0
    for first in range(0, _DRAWS, _TOGETHER):
        x, y = (places[:, first : first + _TOGETHER] for places in (xs, ys))
        enough = _room(arena, x, y) >= np.array([[margin] for margin in margins.values()])
        if arena.territory:
            goal = arena.territory
            enough[1] &= np.hypot(x[1] - goal.x, y[1] - goal.y) >= goal.radius + starts.separation
        fits |= enough.any(axis=1)
        apart = np.hypot(x[0] - x[1], y[0] - y[1])[enough.all(axis=0)]
        reach = max(reach, float(apart.max(initial=0.0)))
        if reach >= starts.separation:
            if game.teams:
                _check_room_of_teams(game, [np.stack([x[side], y[side]])[:, enough[side]] for side in (0, 1)])
            return
    for (name, margin), fit in zip(margins.items(), fits, strict=True):
        if not fit:
            raise InvalidInput(
                f"the arena leaves the {name} no place to start: none of {_DRAWS:,} has a clearance of {margin:g} m "
                f"(starts.clearance + {name}.radius); make the obstacles or the clearance smaller, or the arena larger."
            )
    if not reach:
        raise InvalidInput(
            f"the arena leaves the robots no place to start: at none of {_DRAWS:,} pairs of places both are free; make "
            "the obstacles, starts.clearance or the robots smaller, or the arena larger."
        )
    require(
        False, "starts.separation", starts.separation,
        f"at most {reach:.3g} m, the largest distance of the free pairs among {_DRAWS:,}; make it smaller or the arena "
        "larger",
    )  # fmt: skip


def _check_room_of_teams(game: "Game", free: Sequence[Float[np.ndarray, "2 _places"]]) -> None:
    """However the first robots happen to stand, the last ones must find room.

    Args:
        free: some places [m] with room enough for one of the pursuers, and some for one of the evaders.
    """
    starts, rng = game.starts, np.random.default_rng(1)
    # In the order in which starts are drawn.
    order = [(side, body) for side in (0, 1) for body in game.bodies[side][:1]]
    order += [(side, body) for side in (0, 1) for body in game.bodies[side][1:]]
    for _ in range(_PLACINGS):
        placed: list[tuple[int, float, np.ndarray]] = []
        for side, body in order:
            room = np.ones(free[side].shape[1], bool)
            for other_side, radius, place in placed:
                mates = starts.clearance + body.radius + radius
                least = mates if side == other_side else starts.separation
                room &= np.hypot(*(free[side] - place[:, None])) >= least
            if not room.any():
                remedy = "fewer robots, a smaller starts.clearance or starts.separation, or a larger arena"
                require(False, "teams", game.size, f"of so many robots as the arena has room for; take {remedy}")
            placed.append((side, float(body.radius), free[side][:, rng.choice(np.flatnonzero(room))]))


def _room(
    arena: "Arena", x: Float[np.ndarray, "2 places"], y: Float[np.ndarray, "2 places"]
) -> Float[np.ndarray, "2 places"]:
    """Clearances [m]; those of walls and discs without a compilation, of which every game would need its own."""
    room = np.minimum(np.minimum(x - arena.x_min, arena.x_max - x), np.minimum(y - arena.y_min, arena.y_max - y))
    for disc in arena.discs:
        room = np.minimum(room, np.hypot(x - disc.x, y - disc.y) - disc.radius)
    if len(arena.obstacles) > len(arena.discs):
        places = x.ravel().astype(np.float32), y.ravel().astype(np.float32)
        with jax.ensure_compile_time_eval():  # a game may be made while a function that uses it is traced
            room = np.minimum(room, np.asarray(_to_obstacles(arena, *places)).reshape(x.shape))
    return room
