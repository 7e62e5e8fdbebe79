"""How the rules end a game along two courses."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from apollonius.game.game import Game, judge
from apollonius.game.types import GameState, Outcome, RobotState, Scalar
from apollonius.solve.motion import ends


def first_event(game: Game, pursuer: RobotState, evader: RobotState) -> tuple[Bool[Array, ""], Int[Array, ""], Scalar]:
    """Whether the rules end the game along two courses, leaves `[steps + 1]`; how, and after how many seconds."""
    start = jnp.zeros((), jnp.int32)

    def one_step(before: tuple[RobotState, RobotState], after: tuple[RobotState, RobotState]) -> Int[Array, ""]:
        return judge(game, GameState(*before, start), GameState(*after, start))

    outcomes = jax.vmap(one_step)(*zip(ends(pursuer), ends(evader), strict=True))
    over = outcomes != Outcome.ONGOING
    first = jnp.argmax(over)
    return over[first], outcomes[first], (first + 1).astype(jnp.float32) * game.dt
