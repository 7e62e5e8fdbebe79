"""How the rules end a game along two courses."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from apollonius.game.game import Game
from apollonius.game.judge import judge
from apollonius.game.outcome import decide, is_captured
from apollonius.game.types import GameState, Outcome, RobotState, Role, Scalar
from apollonius.solve.motion import ends

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
    """Each step of some courses of one robot, leaves `[steps, n, games]`."""
    body, arena = game.body(role), game.arena

    def judged(before: RobotState, after: RobotState) -> Alone:
        arrives = arena.reaches_territory(before, after) if arena.territory and role == Role.EVADER else None
        hit, out = arena.hits_obstacle(before, after, body.radius), arena.is_out_of_range(after, body.radius)
        return Alone(before, after, hit, out, arrives)

    return jax.vmap(jax.vmap(jax.vmap(judged)))(*ends(courses))
