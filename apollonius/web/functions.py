"""The functions that the page runs: the rules, charts, observations, and players.

Each is an ordinary JAX function of the package's own parts, which `jaxpr2c` translates.
The numbers of robots, obstacles, cells and units are data, so that one program serves every game
and agent of the page.
"""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, UInt32

from apollonius.agents.path_following import search_view
from apollonius.agents.wrappers import clearance_penalty as penalties
from apollonius.agents.wrappers.backup import MARGIN, steps_to_rest
from apollonius.arenas.charting import clearances, paths
from apollonius.game.chart import COARSE, NO_PATH, Chart, entries
from apollonius.game.dynamics import MIRRORED, Unicycle
from apollonius.game.game import Game
from apollonius.game.sensing import Sensing, Sensors
from apollonius.game.types import (
    NUM_ACTIONS,
    GameState,
    MoverStates,
    RobotState,
    RobotStatus,
    Role,
    Scalar,
    tree_where,
)
from apollonius.observe import tracking
from apollonius.observe.belief import NEVER
from apollonius.observe.team import TEAM
from apollonius.observe.view import Robot, view_of
from apollonius.web.dynamic_game import (
    AnyMovers,
    DynamicBackup,
    Field,
    Floor,
    Robots,
    SearcherState,
    at,
)
from apollonius.web.site import ROBOTS

UNITS = 64
"""Units of a layer whose weights lie together in memory."""
Levels = Float[Array, "2"]


# ---- rules


def step_robots(
    robots: Robots,
    floor: Floor,
    field: Field,
    movers: AnyMovers,
    mover_states: MoverStates,
    levels: Float[Array, "robots 2"],
    capture_distance: Scalar,
    dt: Scalar,
    steps: Int[Array, ""],
    max_steps: Int[Array, ""],
) -> dict[str, Any]:
    """Return the robots after a step, pursuers first, the movers and the outcome.

    Args:
        robots: The robots.
        floor: The arena.
        field: The field of its map.
        movers: The movers.
        mover_states: Where they are.
        levels: Control levels of each robot, in [-1, 1].
        capture_distance: Distance of a capture [m].
        dt: Duration of the step [s].
        steps: Steps so far.
        max_steps: Steps until the time limit.
    """
    game = replace(robots.game(floor.arena(field), capture_distance, dt, max_steps), movers=movers)
    state = replace(robots.state, steps=steps, movers=mover_states)
    after = game.step(state, list(levels[:ROBOTS]), list(levels[ROBOTS:]))
    states, status = (
        jax.tree.map(lambda *leaves: jnp.stack(leaves), *pairs.pursuer, *pairs.evader)
        for pairs in (after.state.robots, after.state.status)
    )
    return {
        "states": states,
        "status": status,
        "movers_after": after.state.movers,
        "outcome": after.outcome,
    }


def start_movers(
    robots: Robots,
    movers: AnyMovers,
    clock_shares: Float[Array, "timed tries"],
    walker_places: tuple[Float[Array, "walkers tries"], Float[Array, "walkers tries"]],
    bits: UInt32[Array, " walkers"],
    room: Scalar,
    dt: Scalar,
) -> dict[str, MoverStates]:
    """Return movers at the start, where they leave robots their room.

    Args:
        robots: The robots.
        movers: The movers.
        clock_shares: Drawn for shuttles and doors, from 0 to 1.
        walker_places: x and y drawn for walkers [m].
        bits: Random bits of walkers.
        room: Least distance of a mover from a robot's body [m].
        dt: Duration of a step [s].
    """
    rows = [at((robots.states, robots.bodies.radius), number) for number in range(2 * ROBOTS)]
    return {"movers_after": movers.start(clock_shares, walker_places, bits, rows, room, dt)}


def move(robots: Robots, levels: Levels, dt: Scalar) -> RobotState:
    """Return the first robot after it has held an action."""
    body, robot = robots.first
    return body.move(robot, *body.controls(levels), dt)


def clearance(floor: Floor, field: Field, x: Scalar, y: Scalar) -> Scalar:
    """Compute the clearance of a point [m].

    Args:
        floor: The arena.
        field: The field of its map.
        x: Coordinate of the point [m].
        y: Coordinate of the point [m].
    """
    return floor.arena(field).clearance(x, y)


def clearance_along(robots: Robots, floor: Floor, field: Field) -> Scalar:
    """Return the least clearance on the segment between the first two robots [m]."""
    return floor.arena(field).clearance_along(at(robots.states, 0), at(robots.states, 1))


# ---- what robots see, and what players do


def network(
    weights: Float[Array, " weights"],
    sizes: Int[Array, " layers"],
    count: Int[Array, ""],
    symmetric: Int[Array, ""],
    inputs: Float[Array, " inputs"],
) -> Float[Array, " outputs"]:
    """Return the outputs of fully connected layers with ReLU between them, as
    `apollonius.agents.network.QNetwork`.

    Args:
        weights: of each layer, for every `UNITS` units their biases and then, input by input, their
            weights.
        sizes: numbers of inputs of each layer, and of outputs of the last one.
        count: of layers.
        symmetric: 1 for a symmetric network, otherwise 0.
    """
    assert TEAM.mirror, "it begins with that of egocentric"
    image = inputs.at[: TEAM.size].set(TEAM.mirror(inputs[: TEAM.size]))
    exchanged = np.array([*MIRRORED, *range(NUM_ACTIONS, UNITS)])

    def layer(number: Int[Array, ""], carry: tuple[Array, Array]) -> tuple[Array, Array]:
        offset, hidden = carry
        block = (sizes[number] + 1) * UNITS
        blocks = (sizes[number + 1] + UNITS - 1) // UNITS

        def some(which: Int[Array, ""], after: Array) -> Array:
            start = offset + which * block

            def add(place: Int[Array, ""], total: Array) -> Array:
                return total + hidden[place] * jax.lax.dynamic_slice(
                    weights, (start + (place + 1) * UNITS,), (UNITS,)
                )

            biases = jax.lax.dynamic_slice(weights, (start,), (UNITS,))
            total = jax.lax.fori_loop(0, sizes[number], add, biases)
            total = jnp.where(number == count - 1, total, jax.nn.relu(total))
            return jax.lax.dynamic_update_slice(after, total, (which * UNITS,))

        return offset + blocks * block, jax.lax.fori_loop(0, blocks, some, jnp.zeros_like(hidden))

    def add_side(side: Int[Array, ""], total: Array) -> Array:
        side_inputs = jnp.where(side == 0, inputs, image)
        outputs = jax.lax.fori_loop(0, count, layer, (jnp.zeros((), jnp.int32), side_inputs))[1][
            :UNITS
        ]
        return total + jnp.where(side == 0, outputs, outputs[exchanged])

    total = jax.lax.fori_loop(0, 1 + symmetric, add_side, jnp.zeros(UNITS, jnp.float32))
    return total / (1 + symmetric).astype(jnp.float32)


def clearance_penalty(
    inputs: Float[Array, " inputs"], margin: Scalar, loss_value: Scalar
) -> Float[Array, "9"]:
    """Compute the penalty of each action that leaves less than the clearance margin.

    Args:
        inputs: the numbers of `egocentric` and any others after them.
        margin: the clearance that an action should leave a robot that then brakes [m].
        loss_value: value of a lost game.
    """
    return penalties.action_penalties(inputs, margin, loss_value)


def clearance_after(
    robots: Robots,
    levels: Levels,
    dt: Scalar,
    floor: Floor,
    field: Field,
    movers: AnyMovers,
    mover_states: MoverStates,
) -> Scalar:
    """Return the least clearance during an action of the first robot and its best manoeuvre to rest
    after it [m].

    It is less, but more than `MARGIN`, where nothing is within reach of any manoeuvre to rest.
    """
    arena, (body, robot) = floor.arena(field), robots.first
    movers_in_view = movers.in_view(mover_states.motion)
    backup = DynamicBackup(
        arena, dt, steps_to_rest(body, dt), may_reverse=True, movers=movers_in_view
    )
    after = move(robots, levels, dt)
    longest = after.v**2 / (2 * body.u1_max) + after.v * dt
    least = (
        jnp.minimum(
            arena.clearance_along(robot, after), arena.clearance(after.x, after.y) - longest
        )
        - body.radius
    )
    is_enough = (least > MARGIN) & (body.v_min >= 0) & (floor.counts[3] == 0)
    is_enough &= movers.count == 0
    return jax.lax.cond(
        is_enough, lambda: least, lambda: backup.clearance_after(Robot(body, robot), levels)
    )


def search(
    robots: Robots,
    floor: Floor,
    field: Field,
    chart: Chart,
    capture_distance: Scalar,
    dt: Scalar,
    searcher: SearcherState,
    shares: Float[Array, " coarse"],
) -> dict[str, Any]:
    """Update the first robot's knowledge by a look at its one opponent; return it with the opponent
    as a pursuer seeks it: as it was seen lately, or at rest where it can be.

    `sight` says whether it was ever seen.

    Args:
        searcher: before it; of a negative age where the game begins.
        shares: random numbers from 0 to 1.
    """
    view, role = robots.view(floor.arena(field), chart, capture_distance, dt), Role.PURSUER
    own, opponent = view.own, view.opponents[0]
    sensors = Sensing(pursuer=Sensors(line_of_sight=True))
    game = Game(
        own.body,
        opponent.body,
        view.arena,
        capture_distance,
        dt,
        jnp.ones((), jnp.int32),
        sensors=sensors,
        chart=chart,
    )
    state = GameState.of_two(own.state, opponent.state, jnp.zeros((), jnp.int32))
    first = tracking.init_track(game, state, role)
    assert first is not None, "it has sensors"
    is_new, initial = searcher.track.ages[0] < 0, SearcherState(first, jnp.full((), -1, jnp.int32))
    before = tree_where(is_new, initial, searcher)
    track, knowledge = tracking.sense_and_update(game, role, before.track, state, jnp.uint32(0))
    assert track is not None, "it has sensors"
    sought, cell = search_view(view_of(game, knowledge, role), before.cell, shares)
    sight = (track.ages[0] < NEVER).astype(jnp.int32)
    return {"after": SearcherState(track, cell), "sought": sought.opponent.state, "sight": sight}


def chart(
    floor: Floor, field: Field, corners: Float[Array, "2 corners"], side: Scalar, radius: Scalar
) -> dict[str, Chart]:
    """Return the chart of an arena.

    Args:
        corners: x and y [m] of the corners of the chart's cells.
        side: length of the arena's longer side [m].
        radius: of the body that follows its paths [m].
    """
    clearance_field = clearances(floor.arena(field), corners[0], corners[1])
    lengths, visible = paths(clearance_field, side, radius)
    x, y = corners[:, :1]
    links = entries(clearance_field, visible, COARSE)[None]
    arrays = clearance_field[None], lengths[None], visible[None], x, y, side[None], links
    return {"chart": Chart(*arrays, member=jnp.zeros((), jnp.int32))}


def arrival_advantage(
    robots: Robots, chart: Chart, capture_distance: Scalar
) -> Float[Array, " coarse"]:
    """Return the evaders' lead over the pursuers at each coarse cell [s], on shortest paths at full
    thrust.

    It is NaN where no path leads, or where one side is out of play.
    """

    def time(body: Unicycle, robot: RobotState, reach: Scalar) -> Float[Array, " coarse"]:
        cells, weights = chart.cell_weights(robot.x, robot.y)
        lengths = weights @ (chart.lengths_between(cells, jnp.arange(COARSE**2)) / 100)
        remaining = jnp.maximum(lengths - reach, 0)
        v = jnp.maximum(robot.v, 0)
        thrust = jnp.maximum(body.u1_max, 1e-6)
        ramp = (body.v_max**2 - v**2) / (2 * thrust)
        slower = (jnp.sqrt(v**2 + 2 * thrust * remaining) - v) / thrust
        faster = (body.v_max - v) / thrust + (remaining - ramp) / body.v_max
        return jnp.where(
            lengths < NO_PATH // 100, jnp.where(remaining < ramp, slower, faster), jnp.inf
        )

    def first(side: slice) -> Float[Array, " coarse"]:
        return jnp.where(jnp.any(active[side]), jnp.min(times[side], axis=0), jnp.nan)

    active = robots.status == RobotStatus.ACTIVE
    reach = jnp.where(jnp.arange(2 * ROBOTS) < ROBOTS, capture_distance, 0)
    times = jnp.where(active[:, None], jax.vmap(time)(robots.bodies, robots.states, reach), jnp.inf)
    return first(slice(ROBOTS)) - first(slice(ROBOTS, None))
