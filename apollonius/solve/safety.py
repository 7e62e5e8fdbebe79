"""The viability kernel of one robot: the states from which it can keep from touching anything for ever.

The value of a state is the room that can be kept,

    V = max over actions of min(room while the action is held, V after it),

the safety Bellman equation (Fisac, Lugovoy, Rubies-Royo, Ghosh, Tomlin, "Bridging Hamilton-Jacobi safety analysis and
reinforcement learning", ICRA 2019, eq. 5, with max-min of the room in place of the signed distance). The kernel is
where V >= 0. Begun at the clearance, the iteration only goes down.

Nothing discounts what comes later, so a small change in the last sweep says little of how far there is to go: where a
hold moves a robot by less than a cell, values sink a little in each of many sweeps. For a robot that comes to rest
sweeps therefore go on until not one value changes. The backup is monotone, in single precision too, and begins above
every fixed point; so what it stops at is the largest one, to rounding. What interpolation errs by remains. A robot
that cannot stop has its room worn away by interpolation without end; its sweeps stop at a residual of `TOLERANCE`, and
by how much its table is above a fixed point is not known.
"""

from collections.abc import Callable
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from apollonius.agents.shield import BRAKING, Backup, brakes
from apollonius.game.game import Game
from apollonius.game.types import RobotState, Role, Scalar
from apollonius.io.limits import require_memory
from apollonius.solve.grid import FEWER_NODES, TOLERANCE, Grid, Solved, Sweep, iterate, silent
from apollonius.solve.motion import Motion, last, motion_of
from apollonius.solve.transition_map import TransitionMap, rooms, transition_map_of

BYTES_PER_NODE = 4 * (9 + 5)
"""The rooms of nine actions; the table before and after a sweep, padded, and what is between."""


def solve_safety(game: Game, role: Role, grid: Grid, hold: int, report: Callable[[Sweep], None] = silent) -> Solved:
    """The room [m] that one side's robot can keep, at every node of a grid.

    Of a robot that comes to rest, the residual is 0: the table is a fixed point and not above one. Of any other, and in
    the rare case that 10,000 sweeps did not suffice, it is not 0, and the table is above one by more than the residual.

    Args:
        hold: control steps for which an action is held; a robot that may change its mind sooner is at least as safe.
        report: told after each sweep.

    Raises:
        InvalidInput: when it does not fit into memory.
    """
    require_memory("grid", grid.name, grid.size * BYTES_PER_NODE, FEWER_NODES)
    motion = motion_of(game, role, hold)
    transitions = transition_map_of(motion, grid)
    room = rooms(motion, grid, transitions)
    x, y = grid.places()
    here = jax.vmap(lambda row: jax.vmap(lambda column: motion.arena.clearance(row, column))(y))(x)
    start = grid.over_places(here - motion.body.radius)
    tolerance = 0.0 if motion.body.brakes_to_rest else TOLERANCE
    return iterate(lambda table: _sweep(transitions, room, table), start, report, tolerance)


@eqx.filter_jit
def _sweep(
    transitions: TransitionMap, room: Float[Array, "slices 9 x y"], table: Float[Array, "v heading x y"]
) -> tuple[Float[Array, "v heading x y"], Scalar]:
    after = transitions.backup(table, lambda index, action, later: jnp.minimum(room[index, action], later))
    after = jnp.minimum(after, table)  # it is no more anyway; but by rounding, values might go up and down for ever
    return after, jnp.max(table - after)


class Steering(eqx.Module):
    """The manoeuvre that brakes and turns as a table of rooms advises, one step ahead.

    Attributes:
        motion: the robot, one step at a time.
        grid, table: the room [m] that can be kept.
    """

    motion: Motion
    grid: Grid
    table: Float[Array, "v heading x y"]

    def __call__(self, robot: RobotState) -> Int[Array, ""]:
        """The braking action after which most room can be kept."""

        def room(action: Int[Array, ""]) -> Scalar:
            course = self.motion.hold(robot, action)
            return jnp.minimum(self.motion.room(course), self.grid.interpolate(self.table, last(course)))

        actions = jnp.array(BRAKING)
        return actions[jnp.argmax(jax.vmap(room)(actions))]


def steered_brakes(game: Game, role: Role, grid: Grid, table: Float[Array, "v heading x y"]) -> Backup:
    """The shield's manoeuvres, and one more that steers by the table of `solve_safety`.

    What they show to be safe is safe, whatever the grid: they are played in the continuous game.

    Raises:
        InvalidInput: when that side's robot cannot brake to rest.
    """
    backup = brakes(game, role)
    steering = Steering(motion_of(game, role, 1), grid, table)
    return replace(backup, manoeuvres=(*backup.manoeuvres, steering))
