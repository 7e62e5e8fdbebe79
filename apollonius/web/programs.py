"""The programs of the page, and of a user's own player: the functions of `functions.py`, translated
and compiled.
"""

import hashlib
import inspect
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int

from apollonius.agents.classical import AbstractClassical
from apollonius.agents.guidance import Flee, FleeAware, Intercept, PurePursuit, Territory
from apollonius.agents.network import MOST_LAYERS, MOST_WIDTH
from apollonius.agents.policy import AbstractPolicy
from apollonius.agents.surrounding import Encirclement, VoronoiPursuit
from apollonius.agents.wrappers.departure import departure_costs
from apollonius.export.writing import refuse_untranslatable
from apollonius.game.arena import MOST_DISCS, MOST_EDGES, Disc
from apollonius.game.chart import COARSE, SIDE, Chart
from apollonius.game.movers import TRIES
from apollonius.game.polygon import Edge
from apollonius.game.timetable import MOST_WAYPOINTS, duration
from apollonius.game.types import MoverMotion, MoverStates, RobotState, Scalar
from apollonius.game.walkers import Walkers
from apollonius.io.document import write_atomically
from apollonius.io.errors import require
from apollonius.observe.belief import Belief
from apollonius.observe.registry import find_observation
from apollonius.observe.tracking import Sightings, Track
from apollonius.observe.view import View
from apollonius.web import functions
from apollonius.web.dynamic_game import (
    AnyDoor,
    AnyMovers,
    AnyRobot,
    AnyShuttle,
    Field,
    Floor,
    Robots,
    SearcherState,
)
from apollonius.web.site import DOORS, READS, ROBOTS, SHUTTLES, WALKERS
from jaxpr2c.compiler import compile_texts
from jaxpr2c.program import Program
from jaxpr2c.translator import translate

T = TypeVar("T")
_ENDLESS = 2**28
"""Length of arrays that the page makes as long as it needs."""


_RULES: dict[str, AbstractClassical] = {
    "pure_pursuit": PurePursuit(),
    "intercept": Intercept(),
    "flee": Flee(),
    "flee_aware": FleeAware(),
    "guard": Territory(guards=True),
    "reach": Territory(guards=False),
    "voronoi_pursuit": VoronoiPursuit(),
    "encirclement": Encirclement(),
}


def _make_program(function: Callable[..., Any], name: str | None = None, **shapes: Any) -> Program:
    """Return a function's program, for arguments of the page's shapes, by their names, or of
    these.
    """
    shapes = jax.eval_shape(_examples) | shapes
    arguments = (shapes[parameter] for parameter in inspect.signature(function).parameters)
    with jax.numpy_dtype_promotion("standard"):  # numbers that are Python's elsewhere are data here
        return translate(function, *arguments, name=name or function.__name__, keep_unused=True)


def _of_view(name: str, answer: Callable[[View], Array]) -> Program:
    """Return the program that answers all that a robot sees."""

    def view(
        robots: Robots,
        floor: Floor,
        field: Field,
        chart: Chart,
        movers: AnyMovers,
        mover_states: MoverStates,
        capture_distance: Scalar,
        dt: Scalar,
    ) -> Array:
        view = robots.view(floor.arena(field), chart, capture_distance, dt)
        return answer(replace(view, movers=movers.in_view(mover_states.motion)))

    return _make_program(view, name)


def player_program(player: AbstractPolicy) -> Program:
    """Return a player of a user's own as the page calls it, from all that a robot sees to its
    action; raises InvalidInput for a player with a memory or with continuous actions.
    """
    plays = not jax.tree.leaves(player.memory) and not player.continuous
    require(
        plays,
        "player",
        type(player).__name__,
        "one with discrete actions and without a memory, to play in the page",
    )

    def act(view: View) -> Int[Array, ""]:
        return jnp.asarray(player(player.observation(view), (), jnp.uint32(0))[0], jnp.int32)

    return _of_view("own", act)


def page_programs() -> Iterator[Program]:
    """Yield all programs of the page."""
    yield _make_program(
        functions.step_robots, levels=jax.ShapeDtypeStruct((2 * ROBOTS, 2), jnp.float32)
    )
    rules = (
        functions.start_movers,
        duration,
        functions.move,
        functions.clearance,
        functions.clearance_along,
        functions.clearance_after,
    )
    for function in (
        *rules,
        functions.chart,
        functions.arrival_advantage,
        functions.network,
        functions.clearance_penalty,
        functions.search,
    ):
        yield _make_program(function)
    for name in READS:
        yield _of_view(name, find_observation(name))
    yield _of_view("departure_costs", departure_costs)
    for name, player in _RULES.items():
        yield _of_view(name, player.values)


def _examples() -> dict[str, Any]:
    """Return arguments of the page's shapes by their names."""

    def real(*shape: int) -> Array:
        return jnp.zeros(shape, jnp.float32)

    def whole(*shape: int) -> Array:
        return jnp.zeros(shape, jnp.int32)

    def several(count: int, tree: T) -> T:
        return jax.tree.map(lambda leaf: jnp.zeros((count, *leaf.shape), leaf.dtype), tree)

    number, many = real(), 2 * ROBOTS
    body, robot = (
        AnyRobot(*[number] * len(fields(AnyRobot))),
        RobotState(number, number, number, number),
    )
    disc, edge = Disc(number, number, number), Edge(number, number, number, number, whole())
    lengths = jnp.zeros((1, COARSE**2, COARSE**2), jnp.uint16)
    visible = jnp.zeros((1, SIDE, SIDE), jnp.uint16)
    links = jnp.zeros((1, COARSE, COARSE), jnp.uint32)
    belief = Belief(real(COARSE, COARSE), real(COARSE, COARSE))
    timed, count = SHUTTLES + DOORS, SHUTTLES + DOORS + WALKERS
    shuttle = AnyShuttle(real(MOST_WAYPOINTS, 2), *[number] * 6, count=whole())
    groups = (Walkers(1, number, number, number),) * WALKERS
    doors = (AnyDoor(*[number] * 9),) * DOORS
    walkers = real(WALKERS)
    bits = jnp.zeros(WALKERS, jnp.uint32)
    motion = MoverMotion(*[real(count)] * 4)
    return {
        "robots": Robots(several(many, body), several(many, robot), whole(many)),
        "floor": Floor(
            real(4), disc, several(MOST_DISCS, disc), several(MOST_EDGES, edge), real(3), whole(4)
        ),
        "field": real(_ENDLESS),
        "movers": AnyMovers((shuttle,) * SHUTTLES, doors, groups, whole(), whole()),
        "mover_states": MoverStates(motion, real(timed), walkers, walkers, bits),
        "clock_shares": real(timed, TRIES),
        "walker_places": (real(WALKERS, TRIES),) * 2,
        "bits": bits,
        "chart": Chart(
            real(1, SIDE + 1, SIDE + 1),
            lengths,
            visible,
            real(1),
            real(1),
            real(1),
            links,
            member=whole(),
        ),
        "searcher": SearcherState(
            Track((robot,), (robot,), (number,), None, belief, Sightings(whole(), whole())), whole()
        ),
        "shares": real(COARSE**2),
        "corners": real(2, SIDE + 1),
        "levels": real(2),
        "weights": real(_ENDLESS),
        "sizes": whole(MOST_LAYERS + 2),
        "inputs": real(MOST_WIDTH),
        **dict.fromkeys(("x", "y", "side", "radius", "capture_distance", "dt", "room"), number),
        **dict.fromkeys(("margin", "loss_value", "length", "v_max", "a_max"), number),
        **dict.fromkeys(("steps", "max_steps", "count", "symmetric"), whole()),
    }


_FLAGS = ("-target", "wasm32-wasi", "-std=c99", "-Os", "-msimd128", "-s")
_STACK = 2**24
"""For the arrays of functions [bytes]; the paths of a chart have 5 MB."""
OF_PAGE = ("-mexec-model=reactor", f"-Wl,-z,stack-size={_STACK},--export=__heap_base")
"""Flags for a module with a memory of its own."""
_OWN, _OWN_END = 2**26, 2**26 + 2**23
"""Addresses in the page's memory of the constants and the stack of a user's own player, as in
`programs.js` [bytes].
"""
_OF_PLAYER = (
    "-mexec-model=reactor",
    f"-Wl,-z,stack-size={2**21},--import-memory,--global-base={_OWN},--initial-memory={_OWN_END}",
)


def sources(programs: Iterable[Program]) -> dict[str, str]:
    """Return the C files of all programs by their names."""
    return {name: text for program in programs for name, text in program.files().items()}


def sources_digest(files: dict[str, str]) -> str:
    """Return the SHA-256 of C files."""
    return hashlib.sha256(
        "".join(f"{name}\n{text}" for name, text in files.items()).encode()
    ).hexdigest()


def compile_programs(programs: Sequence[Program], flags: Sequence[str]) -> bytes:
    """Return the module with some programs; raises InvalidInput where the compiler is not
    installed.
    """
    require(
        find_spec("ziglang") is not None,
        "ziglang",
        "missing",
        "installed, as it compiles: pip install ziglang",
    )
    texts = sources(programs)
    command = [sys.executable, "-m", "ziglang", "cc", *_FLAGS, *flags]
    command += [f"-Wl,--export={program.name}" for program in programs]
    command += [*(name for name in texts if name.endswith(".c")), "-lm"]
    with compile_texts(texts, "ziglang", command) as module:
        return module.read_bytes()


@refuse_untranslatable()
def write_player(player: AbstractPolicy, path: Path) -> None:
    """Write a player as a file that `apollonius play --against FILE` takes; raises InvalidInput for
    a player that the page cannot play, or where the compiler is not installed.
    """
    write_atomically(path, compile_programs([player_program(player)], _OF_PLAYER))
