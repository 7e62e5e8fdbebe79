"""The best response on a grid: what is the most that a side can get from an opponent whose every action it knows.

With b the opponent's action where the robots are, g where it goes and f where the responder goes,

    V(s, o) = E[ max over a of  discount * E[ V(f(s, a), o') ] ],    o' = g(o, b(s, o)).

Of an opponent that acts by chance, b is drawn several times at each pair of nodes, and E is over these draws as well.

The responder knows where the opponent goes, so it may choose for each o' by itself: again two one-sided backups. A hold
that the responder does not survive is lost, one that the opponent does not survive is won. Where the responder can
decide the game by a capture that it wants, or cannot help one that it does not want, it is worth that; against chance
where each of the draws has that capture if it is wanted, and where one of them has if it is not.

On the grid an opponent with continuous actions takes the nearest discrete ones. What comes of it is a table to play by,
with the opponent's own actions in the hold that comes (`foresight.ResponsePolicy`), and is judged by the games it wins.
"""

from collections.abc import Callable
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, UInt8, UInt32

from apollonius.agents.policy import AbstractPolicy
from apollonius.game.dynamics import nearest_action
from apollonius.game.types import NUM_ACTIONS, RobotState, Role, Scalar
from apollonius.solve.capture import Answers, Decided, decisive
from apollonius.solve.foresight import COURSES, answer_of, answers_by_chance
from apollonius.solve.grid import Grid, Solved, Sweep, iterate, lanes_of, silent
from apollonius.solve.joint import TOLERANCE, JointTable, before_move, make_sides, refreshed, tile_of
from apollonius.solve.motion import discount_after
from apollonius.solve.transition_map import Side, greatest, total
from apollonius.solve.zero_sum_game import ZeroSumGame

BYTES_PER_PAIR = 3 * 4 + 2
"""Three tables at a time, and what decides; there are the opponent's actions too, a byte for each draw."""
_EVERY = (1 << NUM_ACTIONS) - 1


class Response(eqx.Module):
    """A side against a known opponent, on a grid.

    Attributes:
        zero_sum_game: the game, from the responder's side.
        own, other: the robots.
        answers: what the opponent does at each pair of nodes.
        decided: the responder's actions that decide the game by a capture.
    """

    zero_sum_game: ZeroSumGame
    own: Side
    other: Side
    answers: Answers
    decided: Decided


def make_response(zero_sum_game: ZeroSumGame, opponent: AbstractPolicy) -> Response:
    """What all sweeps have in common; the opponent is asked at every pair of nodes, as often as chance asks for.

    Raises:
        InvalidInput: as `make_duel`.
    """
    draws = COURSES if answers_by_chance(zero_sum_game, opponent) else 1
    own, other = make_sides(zero_sum_game, BYTES_PER_PAIR + draws)
    answers = _answers(zero_sum_game, opponent, draws)
    return Response(zero_sum_game, own, other, answers, decisive(zero_sum_game, own, other, answers))


@eqx.filter_jit
def _answers(zero_sum_game: ZeroSumGame, opponent: AbstractPolicy, draws: int) -> Answers:
    own, other = zero_sum_game.grids

    def at(first: Int[Array, ""], second: Int[Array, ""], bits: UInt32[Array, ""]) -> UInt8[Array, ""]:
        states = _node(own, first), _node(other, second)
        return nearest_action(answer_of(zero_sum_game, opponent, *states, bits)).astype(jnp.uint8)

    of_draws = jax.vmap(at, (None, None, 0))
    of_others = jax.vmap(of_draws, (None, 0, 0))

    def row(node: Int[Array, ""]) -> UInt8[Array, "other draws"]:
        bits = jax.random.bits(jax.random.fold_in(jax.random.key(0), node), (other.size, draws), jnp.uint32)
        return of_others(node, jnp.arange(other.size), bits)

    return jax.lax.map(row, jnp.arange(own.size))


def solve_response(
    response: Response, report: Callable[[Sweep], None] = silent, tolerance: float = TOLERANCE
) -> Solved:
    """What the responder gets, in tiles in which the opponent moves.

    Args:
        report: told after each sweep.
        tolerance: largest change of a value in the last sweep.
    """
    lanes = lanes_of(response.own.grid)
    table = jnp.zeros((response.own.grid.size // lanes, response.other.grid.size, lanes), jnp.float32)
    return iterate(lambda table: _sweep(response, table), table, report, tolerance)


@partial(eqx.filter_jit, donate="all-except-first")
def _sweep(response: Response, table: JointTable) -> tuple[JointTable, Scalar]:
    zero_sum_game, own, other = response.zero_sum_game, response.own, response.other
    lanes, other_lanes = table.shape[2], lanes_of(other.grid)

    def best(
        tile: Int[Array, ""], index: Int[Array, ""], action: int, later: Float[Array, "x y lanes"]
    ) -> Float[Array, "x y lanes"]:
        return jnp.where(own.free[index, action][..., None], own.motion.discount * later, zero_sum_game.lose)

    moved = jax.lax.map(
        before_move(own, table, other_lanes, best, greatest), jnp.arange(other.grid.size // other_lanes)
    )

    def known(
        tile: Int[Array, ""], index: Int[Array, ""], action: int, later: Float[Array, "x y lanes"]
    ) -> Float[Array, "x y lanes"]:
        rows = jax.lax.dynamic_slice_in_dim(response.answers, tile * lanes, lanes)
        taken = jnp.mean(rows == action, axis=2, dtype=jnp.float32).T.reshape(-1, *other.grid.shape[2:], lanes)[index]
        return taken * jnp.where(other.free[index, action][..., None], later, zero_sum_game.win)

    answered = before_move(other, moved, lanes, known, total)

    actions = jnp.arange(NUM_ACTIONS, dtype=jnp.uint16)[None, :, None, None]
    survived = jnp.sum(own.free.astype(jnp.uint16) << actions, axis=1, dtype=jnp.uint16).reshape(-1)

    def judged(number: Int[Array, ""]) -> Float[Array, "moving lanes"]:
        decided = tile_of(response.decided, number, lanes)
        seconds = (decided >> NUM_ACTIONS).astype(jnp.float32) * zero_sum_game.game.dt
        some = decided & _EVERY
        if zero_sum_game.role == Role.PURSUER:
            certain = some > 0
        else:
            free = jax.lax.dynamic_slice_in_dim(survived, number * lanes, lanes)[None]
            certain = (some > 0) & (some & free == free)
        return jnp.where(certain, zero_sum_game.capture * discount_after(seconds), answered(number))

    return refreshed(table, judged)


def _node(grid: Grid, index: Int[Array, ""]) -> RobotState:
    return grid.node(*jnp.unravel_index(index, grid.shape))
