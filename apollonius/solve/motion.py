"""Motion while actions are held: of one robot alone, and of two robots in a zero-sum game up to its
end.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, UInt8

from apollonius.game.arena import Arena
from apollonius.game.dynamics import Unicycle
from apollonius.game.game import Game
from apollonius.game.outcome import come_within, decide, evader_wins, pursuer_wins
from apollonius.game.types import (
    NUM_ACTIONS,
    Action,
    BySide,
    Outcome,
    Real,
    RobotState,
    Role,
    Scalar,
)
from apollonius.io.limits import HOLD, JOINT_HOLD
from apollonius.solve.grid import Grid

HORIZON = 20.0
"""Time scale [s] of the discount of later outcomes, exp(-t / HORIZON), on the scale of the paper's
games; it tells much longer times apart less well."""
NEVER = 255
"""The step of what does not happen within a hold, later than any step of one."""
UNROLL = 5
"""Steps compiled in a row: quicker than a loop, and no longer to compile for a long hold."""


class Motion(eqx.Module):
    """One robot alone in its arena, by the rules' own dynamics and contact, which holds actions for
    some steps.
    """

    body: Unicycle
    arena: Arena
    dt: Real
    steps: int = eqx.field(static=True)

    @property
    def seconds(self) -> Real:
        return self.steps * self.dt

    @property
    def farthest(self) -> float:
        """Longest distance of a hold [m]."""
        return float(self.body.top_speed * self.seconds)

    @property
    def discount(self) -> Scalar:
        """Value before a hold of what has the value 1 after it."""
        return discount_after(self.seconds)

    def hold(self, robot: RobotState, action: Action) -> RobotState:
        """Return the states along a hold, from the first to that after the last step: leaves
        `[steps + 1]`.
        """
        controls = self.body.controls(action)

        def one_step(before: RobotState, _: None) -> tuple[RobotState, RobotState]:
            after = self.body.move(before, *controls, self.dt)
            return after, after

        _, course = jax.lax.scan(one_step, robot, None, self.steps, unroll=min(self.steps, UNROLL))
        return jax.tree.map(lambda first, rest: jnp.concatenate([first[None], rest]), robot, course)

    def clearance(self, course: RobotState) -> Scalar:
        """Return the least clearance [m] of the body along a course, step by step as the rules
        judge it.
        """
        return jnp.min(jax.vmap(self.arena.clearance_along)(*step_ends(course))) - self.body.radius

    def failure(self, course: RobotState) -> UInt8[Array, ""]:
        """Return the step of a course in which the body first touches something, from 1; `NEVER` if
        in none.
        """
        touches = jax.vmap(self.arena.clearance_along)(*step_ends(course)) < self.body.radius
        return jnp.where(jnp.any(touches), jnp.argmax(touches) + 1, NEVER).astype(jnp.uint8)


def every_hold(motion: Motion, robots: RobotState) -> RobotState:
    """Return the courses of all nine actions in several games, leaves `[games]`: leaves `[steps +
    1, 9, games]`.
    """
    in_games = jax.vmap(motion.hold, (0, None), -1)
    return jax.vmap(in_games, (None, 0), 1)(robots, jnp.arange(NUM_ACTIONS))


def discount_after(seconds: Real | Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """Return the value of an outcome in some seconds that would have the value 1 at once."""
    return jnp.exp(-jnp.asarray(seconds, jnp.float32) / HORIZON)


def step_ends(course: RobotState) -> tuple[RobotState, RobotState]:
    """Return the states before and after each step of a course: leaves `[steps]`."""
    return jax.tree.map(lambda leaf: leaf[:-1], course), jax.tree.map(lambda leaf: leaf[1:], course)


def end_state(course: RobotState) -> RobotState:
    """Return the state at the end of a course."""
    return jax.tree.map(lambda leaf: leaf[-1], course)


def motion_of(game: Game, role: Role, steps: int) -> Motion:
    """Return the motion of one side's robot; raises InvalidInput for a hold of no step, or too long
    for memory.
    """
    HOLD.require("hold", steps)
    game.require_one_arena("a table")
    game.require_two("a table")
    game.require_no_movers("a table")
    return Motion(game.body(role), game.arena, game.dt, steps)


WIN, LOSE = 1.0, -1.0
"""Values of winning and losing at once; later they are discounted by `discount_after`."""


class SoloStep(eqx.Module):
    """A step of one robot, judged without the other one: whether it touches an obstacle, leaves the
    walls, or comes into a territory, if it has one to come to.
    """

    before: RobotState
    after: RobotState
    hit: Bool[Array, "*batch"]
    out: Bool[Array, "*batch"]
    arrives: Bool[Array, "*batch"] | None


def first_events(
    game: Game, pursuer: RobotState, evader: RobotState
) -> tuple[Int[Array, "m n games"], Float[Array, "m n games"]]:
    """Return the outcomes of several games along each pair of courses, and after how many
    seconds.

    Courses have leaves `[steps + 1, m, games]` and `[steps + 1, n, games]`. A robot alone is judged
    once for each course, only captures for every pair.
    """
    solo = _solo_steps(game, Role.PURSUER, pursuer), _solo_steps(game, Role.EVADER, evader)

    def judge_pair(pursuer: SoloStep, evader: SoloStep) -> Int[Array, ""]:
        moves = (pursuer.before, pursuer.after), (evader.before, evader.after)
        return decide(
            captured=come_within(*moves, game.capture_distance),
            pursuer_hit=pursuer.hit,
            pursuer_out=pursuer.out,
            evader_hit=evader.hit,
            evader_out=evader.out,
            out_of_time=jnp.zeros((), bool),
            territory_reached=evader.arrives,
        )

    # Games last: that is the axis along which the processor takes several at a time.
    in_games = jax.vmap(judge_pair)
    of_pairs = jax.vmap(jax.vmap(in_games, (None, 0)), (0, None))

    def one_step(
        before: tuple[Int[Array, "m n games"], Int[Array, "m n games"]],
        solo_steps: tuple[SoloStep, SoloStep],
    ) -> tuple[tuple[Int[Array, "m n games"], Int[Array, "m n games"]], None]:
        outcome, steps = before
        ongoing = outcome == Outcome.ONGOING
        after = jnp.where(ongoing, of_pairs(*solo_steps), outcome)
        return (after, steps + ongoing.astype(jnp.int32)), None

    pairs = (pursuer.x.shape[1], *evader.x.shape[1:])
    start = jnp.full(pairs, Outcome.ONGOING), jnp.zeros(pairs, jnp.int32)
    (outcome, steps), _ = jax.lax.scan(one_step, start, solo, unroll=UNROLL)
    return outcome, steps.astype(jnp.float32) * game.dt


def _solo_steps(game: Game, role: Role, courses: RobotState) -> SoloStep:
    body, arena = game.body(role), game.arena

    def judge_step(before: RobotState, after: RobotState) -> SoloStep:
        arrives = None
        if arena.territory and role == Role.EVADER:
            arrives = arena.reaches_territory(before, after)
        hit = arena.hits_obstacle(before, after, body.radius)
        out = arena.is_out_of_range(after, body.radius)
        return SoloStep(before, after, hit, out, arrives)

    return jax.vmap(jax.vmap(jax.vmap(judge_step)))(*step_ends(courses))


class ZeroSumGame(eqx.Module):
    """The two-robot game, from one side, with the motion and the grid of its robot and then of the
    other's.
    """

    game: Game
    motions: tuple[Motion, Motion]
    grids: tuple[Grid, Grid]
    role: Role = eqx.field(static=True)

    @property
    def capture(self) -> float:
        """Value to this side of a capture at once."""
        return WIN if self.role == Role.PURSUER else LOSE

    def pair(self, own: RobotState, other: RobotState) -> BySide[RobotState]:
        """Return the pursuer's state and the evader's."""
        return BySide.of(self.role, own, other)


def payoff_of(
    role: Role, outcome: Int[Array, "*batch"], seconds: Float[Array, "*batch"]
) -> Float[Array, "*batch"]:
    """Return the value to one side of an outcome after some seconds."""
    pursuer_won = pursuer_wins(outcome)
    evader_won = evader_wins(outcome, time_limit_wins=False)
    wins, losses = BySide.of(role, pursuer_won, evader_won)
    return discount_after(seconds) * jnp.where(wins, WIN, jnp.where(losses, LOSE, 0.0))


def make_zero_sum_game(game: Game, grids: tuple[Grid, Grid], hold: int, role: Role) -> ZeroSumGame:
    """Return the two-robot game from one side.

    Args:
        game: the rules.
        grids: the grids of the pursuer's and the evader's states.
        hold: control steps for which actions are held, 1 to 127.
        role: the side.

    Raises:
        InvalidInput: for another hold, several arenas, or teams.
    """
    JOINT_HOLD.require("hold", hold)
    motions = motion_of(game, role, hold), motion_of(game, role.other, hold)
    return ZeroSumGame(game, motions, (grids[role], grids[role.other]), role)
