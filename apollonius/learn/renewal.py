"""A change of opponents: new versions enter the archives, seats are drawn anew, and their games begin anew."""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array, PRNGKeyArray

from apollonius.game.game import Game, reset_batch
from apollonius.learn import opponents, replay
from apollonius.learn.state import Learning, Plan, TrainState
from apollonius.rollout import Games, Player


@functools.partial(jax.jit, static_argnames="plan", donate_argnames="state")
def renew_opponents(plan: Plan, game: Game, state: TrainState) -> TrainState:
    """Both learners may enter their archives, and who sits is drawn anew; the games of seats are broken off and begin
    anew. The state is consumed.
    """
    config = plan.opponents
    start_key, *keys = jax.random.split(jax.random.fold_in(jax.random.fold_in(state.key, 2), state.iterations), 3)
    seated = opponents.has_seat(config, plan.dqn.games)
    fresh = reset_batch(game, start_key, plan.dqn.games)
    interval = max(1, plan.stage.env_steps // config.versions)
    due = state.env_steps // interval > (state.env_steps - config.renewal) // interval

    def renewed(side: Learning | None, key: PRNGKeyArray) -> Learning:
        assert side is not None, "both sides learn"
        assert side.archive is not None, "both have archives"
        archive = opponents.enter(side.archive, side.learner.average, due)
        return Learning(side.learner, replay.cut(side.replay, seated), opponents.renew(archive, config, key))

    def anew(new: Array, old: Array) -> Array:
        return jnp.where(seated, new, old)

    def player(old: Player) -> Player:
        return Player(old.member, anew(jnp.zeros(()), old.episode_return))

    games = Games(jax.tree.map(anew, fresh, state.games.state), player(state.games.pursuer), player(state.games.evader))
    return TrainState(
        games=games,
        pursuer=renewed(state.pursuer, keys[0]),
        evader=renewed(state.evader, keys[1]),
        key=state.key,
        iterations=state.iterations,
        env_steps=state.env_steps,
        episodes=state.episodes,
    )
