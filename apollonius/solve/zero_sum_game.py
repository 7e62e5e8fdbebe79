"""The two-robot game as one side sees it: what outcomes are worth to it, and what happens while actions are held."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from apollonius.game.by_side import BySide
from apollonius.game.game import Game
from apollonius.game.judge import judge
from apollonius.game.outcome import decide, evader_wins, is_captured, pursuer_wins
from apollonius.game.types import GameState, Outcome, Real, RobotState, Role, Scalar
from apollonius.io.errors import require
from apollonius.io.limits import JOINT_HOLD
from apollonius.solve.grid import Grid
from apollonius.solve.motion import Motion, discount_after, ends, motion_of

_UNROLL = 5
"""Steps compiled in a row."""


def first_event(game: Game, pursuer: RobotState, evader: RobotState) -> tuple[Bool[Array, ""], Int[Array, ""], Scalar]:
    """Whether the rules end the game along two courses, leaves `[steps + 1]`; how, and after how many seconds."""
    start = jnp.zeros((), jnp.int32)

    def one_step(before: tuple[RobotState, RobotState], after: tuple[RobotState, RobotState]) -> Int[Array, ""]:
        return judge(game, GameState.of_two(*before, start), GameState.of_two(*after, start))[0]

    outcomes = jax.vmap(one_step)(*zip(ends(pursuer), ends(evader), strict=True))
    over = outcomes != Outcome.ONGOING
    first = jnp.argmax(over)
    return over[first], outcomes[first], (first + 1).astype(jnp.float32) * game.dt


class Alone(eqx.Module):
    """What a step of one robot comes to, wherever the other one is.

    Attributes:
        before, after: the robot at the two ends of the step.
        hit, out: whether it touches an obstacle, and whether it leaves the walls.
        arrives: whether it comes into the territory; None where it has none to come to.
    """

    before: RobotState
    after: RobotState
    hit: Bool[Array, "*batch"]
    out: Bool[Array, "*batch"]
    arrives: Bool[Array, "*batch"] | None


def first_events(
    game: Game, pursuer: RobotState, evader: RobotState
) -> tuple[Int[Array, "m n games"], Float[Array, "m n games"]]:
    """How the rules end several games along each pair of courses, and after how many seconds.

    What happens to a robot alone is judged once for each of its courses, only captures for every pair of them.

    Args:
        pursuer: some courses of it in each game, leaves `[steps + 1, m, games]`.
        evader: the same, leaves `[steps + 1, n, games]`.
    """
    alone = _steps_alone(game, Role.PURSUER, pursuer), _steps_alone(game, Role.EVADER, evader)
    step = jnp.zeros((), jnp.int32)

    def together(pursuer: Alone, evader: Alone) -> Int[Array, ""]:
        before, after = (
            GameState.of_two(*robots, step)
            for robots in ((pursuer.before, evader.before), (pursuer.after, evader.after))
        )
        return decide(
            captured=is_captured(before, after, game.capture_distance),
            pursuer_hit=pursuer.hit,
            pursuer_out=pursuer.out,
            evader_hit=evader.hit,
            evader_out=evader.out,
            out_of_time=jnp.zeros((), bool),
            territory_reached=evader.arrives,
        )

    # Games last: that is the axis along which the processor takes several at a time.
    in_games = jax.vmap(together)
    of_pairs = jax.vmap(jax.vmap(in_games, (None, 0)), (0, None))

    def one_step(
        so_far: tuple[Int[Array, "m n games"], Int[Array, "m n games"]], taken: tuple[Alone, Alone]
    ) -> tuple[tuple[Int[Array, "m n games"], Int[Array, "m n games"]], None]:
        outcome, steps = so_far
        ongoing = outcome == Outcome.ONGOING
        return (jnp.where(ongoing, of_pairs(*taken), outcome), steps + ongoing.astype(jnp.int32)), None

    pairs = (pursuer.x.shape[1], *evader.x.shape[1:])
    nothing = jnp.full(pairs, Outcome.ONGOING), jnp.zeros(pairs, jnp.int32)
    (outcome, steps), _ = jax.lax.scan(one_step, nothing, alone, unroll=_UNROLL)
    return outcome, steps.astype(jnp.float32) * game.dt


def _steps_alone(game: Game, role: Role, courses: RobotState) -> Alone:
    body, arena = game.body(role), game.arena

    def judged(before: RobotState, after: RobotState) -> Alone:
        arrives = arena.reaches_territory(before, after) if arena.territory and role == Role.EVADER else None
        hit, out = arena.hits_obstacle(before, after, body.radius), arena.is_out_of_range(after, body.radius)
        return Alone(before, after, hit, out, arrives)

    return jax.vmap(jax.vmap(jax.vmap(judged)))(*ends(courses))


PAYOFFS = {"win": (1.0, -1.0), "time": (1.0, 0.0)}
"""What winning and losing is worth to the pursuer, times `discount_after` the seconds until then; else 0."""


class ZeroSumGame(eqx.Module):
    """The two-robot game, from one side. What one gains the other loses.

    Attributes:
        game: the rules.
        motions, grids: of this side's robot, then the other's.
        win, lose: what it is worth to this side to win, and to lose, at once.
        role: the side.
    """

    game: Game
    motions: tuple[Motion, Motion]
    grids: tuple[Grid, Grid]
    win: Real
    lose: Real
    role: Role = eqx.field(static=True)

    @property
    def capture(self) -> Real:
        """What it is worth to this side if the evader is captured at once."""
        return self.win if self.role == Role.PURSUER else self.lose

    def pair(self, own: RobotState, other: RobotState) -> tuple[RobotState, RobotState]:
        """The pursuer's state and the evader's."""
        return BySide.of(self.role, own, other).pair

    def event(self, own: RobotState, other: RobotState) -> tuple[Bool[Array, ""], Float[Array, ""]]:
        """Whether the rules end the game along two courses (leaves `[steps + 1]`), and what that is worth."""
        over, outcome, seconds = first_event(self.game, *self.pair(own, other))
        return over, self.payoff_of(outcome, seconds)

    def payoff_of(self, outcome: Int[Array, "*batch"], seconds: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
        """What an outcome after so many seconds is worth to this side."""
        won, lost = pursuer_wins(outcome), evader_wins(outcome, time_limit_wins=False)
        if self.role == Role.EVADER:
            won, lost = lost, won
        return discount_after(seconds) * jnp.where(won, self.win, jnp.where(lost, self.lose, 0.0))


def make_zero_sum_game(game: Game, grids: tuple[Grid, Grid], hold: int, role: Role, payoff: str) -> ZeroSumGame:
    """The two-robot game from one side.

    Args:
        grids: the pursuer's and the evader's.
        hold: control steps for which actions are held.
        payoff: `win` pays the pursuer 1 for a win and -1 for a loss; `time` pays it 1 for a win alone, so that only the
            time to it counts.

    Raises:
        InvalidInput: for an unknown payoff, and unless an action is held for 1 to 127 steps.
    """
    require(payoff in PAYOFFS, "payoff", payoff, f"one of {', '.join(PAYOFFS)}")
    JOINT_HOLD.require("hold", hold)
    won, lost = PAYOFFS[payoff]
    pursuer, evader = motion_of(game, Role.PURSUER, hold), motion_of(game, Role.EVADER, hold)
    if role == Role.PURSUER:
        return ZeroSumGame(game, (pursuer, evader), grids, won, lost, role)
    return ZeroSumGame(game, (evader, pursuer), (grids[1], grids[0]), -lost, -won, role)
