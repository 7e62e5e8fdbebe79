"""Checks of a game as a whole: finite numbers, and space to start."""

import functools
import math
import os
import re
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from apollonius.game.arena import Arena
from apollonius.game.drive import MOST_LAG, Drives
from apollonius.game.dynamics import Unicycle
from apollonius.game.models import model_name, require_unicycle
from apollonius.game.movers import Movers
from apollonius.game.sensing import Sensing
from apollonius.game.starts import Starts
from apollonius.game.types import BySide
from apollonius.game.uncertainty import Uncertainties
from apollonius.game.walkers import MARGIN
from apollonius.io.errors import InvalidInput, format_value, require
from apollonius.io.limits import ROBOTS

MAX_SIZE = 1e6
"""Largest size of any number of a game: in single precision positions in a larger arena would be
decimetres apart.
"""
_DRAWS = 100_000
"""Pairs of positions among which starts are sought; a rarer start would take for ever to draw."""
_TOGETHER = 5_000
"""Pairs at a time; in most arenas the first few suffice."""
_PLACINGS = 100
"""Starts of teams that are tried out."""
_SIDES = ("pursuer", "evader")
_OPTIONAL = (
    "arena.map",
    "arena.territory",
    "scenario",
    "teams",
    "sensors",
    "drives",
    "uncertainty",
    "movers",
    "chart",
)
"""Beginnings of the names of parts that a game need not have."""

_SINGLE, _SEEDS = "everything here is in single precision", "a seed means other games otherwise"
_SETTINGS: dict[str, tuple[tuple[Any, ...], str]] = {
    "jax_enable_x64": ((False,), _SINGLE),
    "jax_default_matmul_precision": (("highest", "float32", None), _SINGLE),
    "jax_threefry_partitionable": ((True,), _SEEDS),
    "jax_default_prng_impl": (("threefry2x32",), _SEEDS),
    "jax_random_seed_offset": ((0,), _SEEDS),
    "jax_transfer_guard": (
        ("allow", None, "log", "log_explicit"),
        "numbers are sent to the device as games need them",
    ),
}
"""Settings of JAX that matter, with the values that they may have, the usual one first, and why no
other. All others change nothing but speed, messages and, where they choose how XLA compiles, the
last bit of some numbers."""
_FAST = re.compile(r"xla_[a-z]+_enable_fast_(math|min_max)(?!=(false|0))")
"""Flags of XLA that trade accuracy for speed."""

Bodies = BySide[tuple[Unicycle, ...]]
Points = Float[np.ndarray, "2 _points"]

_clearances = jax.jit(jax.vmap(Arena.clearance, in_axes=(None, 0, 0)))


def require_usual_numbers() -> None:
    """Refuse settings of JAX and XLA under which a seed means other games than in all that is
    published.
    """
    for name, (usual, why) in _SETTINGS.items():
        value = getattr(jax.config, name, usual[0])
        require(value in usual, name.upper(), value, f"{format_value(usual[0])}: {why}; unset it")
    flags = os.environ.get("XLA_FLAGS", "")
    require(
        not _FAST.search(flags),
        "XLA_FLAGS",
        flags,
        "without fast-math, which rounds as it likes; take it out",
    )


def require_key(key: Any) -> None:
    """Refuse what is no key of JAX, such as a seed."""
    is_array = isinstance(key, jax.Array | np.ndarray)
    is_key = is_array and (jax.numpy.issubdtype(key.dtype, jax.dtypes.prng_key) or key.ndim > 0)
    seed = key if isinstance(key, int) else 0
    require(is_key, "key", key, f"a key of JAX, as jax.random.key({format_value(seed)})")


def is_swept(game: Any) -> bool:
    """Check whether numbers of a game are traced or swept: arrays, whose values are unknown."""
    return any(isinstance(leaf, (jax.Array, np.ndarray)) for leaf in _numbers(game).values())


def check_finite(game: Any) -> None:
    """Refuse numbers of a game that are not finite, not numbers, or too large."""
    for name, leaf in _numbers(game).items():
        is_number = isinstance(leaf, (int, float)) and not isinstance(leaf, bool)
        require(is_number and abs(leaf) < math.inf, name, leaf, "a finite number")
        require(
            abs(leaf) <= MAX_SIZE or name == "max_steps", name, leaf, f"within {MAX_SIZE:g} of 0"
        )


def _numbers(game: Any) -> dict[str, Any]:
    """Return all numbers by name, but for a map's field, a chart and parts that are left out."""
    leaves = jax.tree_util.tree_flatten_with_path(game, is_leaf=lambda leaf: leaf is None)[0]
    keystr = functools.partial(jax.tree_util.keystr, simple=True, separator=".")
    numbers = {keystr(path): leaf for path, leaf in leaves}
    hidden = {name for name in numbers if name.startswith("chart.")} | {"arena.map.field"}
    absent = {name for name, leaf in numbers.items() if leaf is None}
    hidden |= {name for name in absent if name.startswith(_OPTIONAL)}
    return {name: leaf for name, leaf in numbers.items() if name not in hidden}


def check_parts(sensors: Sensing | None, drives: Drives | None) -> None:
    """Refuse impossible numbers of sensors and drives."""
    for name, parts in (("sensors", sensors), ("drives", drives)):
        for side, part in zip(_SIDES, parts or (), strict=False):
            if part:
                part.check(f"{name}.{side}")


def check_uncertainty(
    uncertainty: Uncertainties | None, drives: Drives | None, bodies: Bodies
) -> None:
    """Refuse impossible bounds, those of a delay without the lag that it adds to, and those of
    robots that are not unicycles.
    """
    sides = zip(_SIDES, uncertainty or (), drives or (None, None), bodies, strict=False)
    for side, bounds, drive, robots in sides:
        if bounds is None:
            continue
        bounds.check(f"uncertainty.{side}")
        for body in robots:
            require_unicycle(body, side, f"uncertainty.{side}")
        has_lag = drive is not None and drive.lag is not None and drive.lag < MOST_LAG
        bound = f"0 s, or beside drives.{side}.lag of 0 to {MOST_LAG - 1} steps, to which it adds"
        require(not bounds.delay or has_lag, f"uncertainty.{side}.delay", bounds.delay, bound)


def check_bodies(bodies: Bodies, dt: float, sensors: Sensing | None, drives: Drives | None) -> None:
    """Refuse too many robots, and robots with impossible limits, sensors or drives.

    Args:
        bodies: the limits of all robots.
        dt: duration of a step [s].
        sensors, drives: of both sides, if any.
    """
    check_parts(sensors, drives)
    for side, robots in zip(_SIDES, bodies, strict=True):
        ROBOTS.require(f"{side}s", len(robots))
        models = sorted({model_name(body) for body in robots})
        bound = "one kind for all robots of a side"
        require(len(models) == 1, f"{side}s.model", ", ".join(models), bound)
        for number, body in enumerate(robots):
            body.check(f"{side}s[{number}]" if len(robots) > 1 else side, dt)


def check_space_to_start(arena: Arena, bodies: Bodies, starts: Starts) -> None:
    """Refuse an arena in which two robots find no start, far enough apart, or their mates none
    beside them.
    """
    samples = np.random.default_rng(0).uniform(size=(4, _DRAWS))
    xs = np.asarray(arena.x_min + (arena.x_max - arena.x_min) * samples[:2])
    ys = np.asarray(arena.y_min + (arena.y_max - arena.y_min) * samples[2:])
    margins = np.array([[starts.clearance + max(body.radius for body in side)] for side in bodies])
    fits, reach = np.zeros(2, bool), 0.0
    for first in range(0, _DRAWS, _TOGETHER):
        x, y = (values[:, first : first + _TOGETHER] for values in (xs, ys))
        is_free = _clearance(arena, x, y) >= margins
        goal = arena.territory
        if goal:
            is_free[1] &= np.hypot(x[1] - goal.x, y[1] - goal.y) >= goal.radius + starts.separation
        fits |= is_free.any(axis=1)
        distances = np.hypot(x[0] - x[1], y[0] - y[1])[is_free.all(axis=0)]
        reach = max(reach, float(distances.max(initial=0.0)))
        if reach >= starts.separation:
            _check_space_for_mates(
                bodies, starts, [np.stack([x[side], y[side]])[:, is_free[side]] for side in (0, 1)]
            )
            return
    for name, (margin,), fit in zip(_SIDES, margins, fits, strict=True):
        if not fit:
            needed = f"a clearance of {margin:g} m (starts.clearance + {name}.radius)"
            problem = f"none of {_DRAWS:,} has {needed}"
            remedy = "make the obstacles or the clearance smaller, or the arena larger"
            raise InvalidInput(
                f"the arena leaves the {name} no place to start: {problem}; {remedy}."
            )
    if not reach:
        problem = f"at none of {_DRAWS:,} pairs of places both are free"
        remedy = "make the obstacles, starts.clearance or the robots smaller, or the arena larger"
        raise InvalidInput(f"the arena leaves the robots no place to start: {problem}; {remedy}.")
    bound = f"at most {reach:.3g} m, the largest distance of the free pairs among {_DRAWS:,}"
    remedy = "make it smaller or the arena larger"
    require(False, "starts.separation", starts.separation, f"{bound}; {remedy}")


def check_movers(movers: Movers | None, arena: Arena) -> None:
    """Refuse impossible movers, and walkers that find no place on the floor."""
    if movers is None:
        return
    movers.check(arena)
    places = np.random.default_rng(2).uniform(size=(2, 2, _TOGETHER))
    x = np.asarray(arena.x_min + (arena.x_max - arena.x_min) * places[0])
    y = np.asarray(arena.y_min + (arena.y_max - arena.y_min) * places[1])
    clearance = float(_clearance(arena, x, y).max())
    for number, group in enumerate(movers.walkers):
        bound = f"less than {clearance:.3g} m, the largest clearance of 10,000 places"
        fits = group.radius + 2 * MARGIN < clearance
        require(fits, f"movers.walkers[{number}].radius", group.radius, bound)


def _check_space_for_mates(bodies: Bodies, starts: Starts, free: Sequence[Points]) -> None:
    """Refuse teams whose last robots find no start among some free points [m], wherever the first
    ones are.
    """
    rng = np.random.default_rng(1)
    # In the order in which starts are drawn.
    first = [(side, body) for side in (0, 1) for body in bodies[side][:1]]
    order = first + [(side, body) for side in (0, 1) for body in bodies[side][1:]]
    for _ in range(_PLACINGS if len(order) > 2 else 0):
        robots: list[tuple[int, float, np.ndarray]] = []
        for side, body in order:
            fits = np.ones(free[side].shape[1], bool)
            for other_side, radius, point in robots:
                contact = starts.clearance + body.radius + radius
                min_distance = contact if side == other_side else starts.separation
                fits &= np.hypot(*(free[side] - point[:, None])) >= min_distance
            if not fits.any():
                smaller = "a smaller starts.clearance or starts.separation"
                remedy = f"fewer robots, {smaller}, or a larger arena"
                size = " v ".join(str(len(robots)) for robots in bodies)
                require(
                    False, "teams", size, f"few enough robots to fit into the arena; take {remedy}"
                )
            robots.append(
                (side, float(body.radius), free[side][:, rng.choice(np.flatnonzero(fits))])
            )


def _clearance(
    arena: Arena, x: Float[np.ndarray, "2 points"], y: Float[np.ndarray, "2 points"]
) -> Float[np.ndarray, "2 points"]:
    """Return clearances [m]; of walls and discs without a compilation, of which every game would
    need its own.
    """
    if len(arena.obstacles) > len(arena.discs):
        points = x.ravel().astype(np.float32), y.ravel().astype(np.float32)
        # a game may be made while a function that uses it is traced
        with jax.ensure_compile_time_eval():
            return np.asarray(_clearances(arena, *points)).reshape(x.shape)
    clearances = np.minimum(
        np.minimum(x - arena.x_min, arena.x_max - x), np.minimum(y - arena.y_min, arena.y_max - y)
    )
    for disc in arena.discs:
        clearances = np.minimum(clearances, np.hypot(x - disc.x, y - disc.y) - disc.radius)
    return clearances
