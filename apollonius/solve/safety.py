"""The viability kernel of one robot: the states from which it can keep from touching anything for
ever.

The value of a state is the clearance that can be kept,

    V = max over actions of min(clearance while the action is held, V after it),

the safety Bellman equation (Fisac, Lugovoy, Rubies-Royo, Ghosh, Tomlin, "Bridging Hamilton-Jacobi
safety analysis and reinforcement learning", ICRA 2019, eq. 5, with max-min of the clearance in
place of the signed distance). The kernel is where V >= 0. Begun at the clearance, the iteration
only goes down.

Nothing discounts what comes later, so a small change in the last sweep says little of how far there
is to go. For a robot that comes to rest sweeps therefore continue until not one value changes. The
backup is monotone, in single precision too, and begins above every fixed point; so what it stops at
is the largest one, to rounding. A robot that cannot stop has its clearance worn away by
interpolation without end; its sweeps stop at a residual of `TOLERANCE`.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from apollonius.game.game import Game
from apollonius.game.types import Role, Scalar
from apollonius.io.limits import require_memory
from apollonius.solve.grid import FEWER_NODES, TOLERANCE, Grid, Report, Solved, iterate_values
from apollonius.solve.motion import motion_of
from apollonius.solve.transition_map import TransitionMap, over_courses, transition_map_of

BYTES_PER_NODE = 4 * (9 + 5)
"""The clearances of nine actions; the table before and after a sweep, padded, and what is between.
"""


def solve_safety(
    game: Game, role: Role, grid: Grid, hold: int, report: Report | None = None
) -> Solved:
    """Compute the clearance [m] that one side's robot can keep, at every node of a grid.

    For a robot that can come to rest the table is a fixed point, and the residual 0; for another
    one the table is above the fixed point by more than the residual.

    Args:
        game: the rules.
        role: the side.
        grid: the grid of its robot's states.
        hold: control steps for which an action is held.
        report: gets the progress after each sweep.

    Raises:
        InvalidInput: if the table does not fit into memory.
    """
    require_memory("grid", grid.name, grid.size * BYTES_PER_NODE, FEWER_NODES)
    motion = motion_of(game, role, hold)
    transitions = transition_map_of(motion, grid)
    clearances = over_courses(motion.clearance, grid, transitions)
    x, y = grid.node_positions()
    clearance_on_grid = jax.vmap(jax.vmap(motion.arena.clearance, (None, 0)), (0, None))
    node_clearance = clearance_on_grid(x, y)
    start = jnp.broadcast_to(node_clearance - motion.body.radius, grid.shape)
    tolerance = 0.0 if motion.body.brakes_to_rest else TOLERANCE
    return iterate_values(
        lambda table: _sweep(transitions, clearances, table), start, report, tolerance
    )


@eqx.filter_jit
def _sweep(
    transitions: TransitionMap,
    clearances: Float[Array, "slices 9 x y"],
    table: Float[Array, "v heading x y"],
) -> tuple[Float[Array, "v heading x y"], Scalar]:
    after = transitions.backup(
        table, lambda index, action, later: jnp.minimum(clearances[index, action], later)
    )
    # Only rounding can raise a value here; without the minimum it could go up and down for ever.
    after = jnp.minimum(after, table)
    return after, jnp.max(table - after)
