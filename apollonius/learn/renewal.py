"""A change of opponents: new versions enter the archives, seats are drawn anew, and their games begin anew."""

import functools
from dataclasses import replace

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from apollonius.game.game import Game, reset_batch
from apollonius.game.types import ROLES, Scalar
from apollonius.learn import opponents, payoffs
from apollonius.learn.algorithm import algorithm_of
from apollonius.learn.replay import cut
from apollonius.learn.seats import has_seat
from apollonius.learn.state import Learning, Plan, TrainState
from apollonius.rollout import Games, anew, fresh_player

Mixture = Float[Array, " versions"]


def renew_opponents(plan: Plan, game: Game, state: TrainState) -> TrainState:
    """Both learners may enter their archives, and who sits is drawn anew; the games of seats are broken off and begin
    anew. The state is consumed.
    """
    state = admit(plan, game, state)
    return reseat(plan, game, state, mixtures_of(plan, state))


def mixtures_of(plan: Plan, state: TrainState) -> tuple[Mixture, Mixture] | None:
    """How likely either side's versions are to sit, where a scheme solves the game between them. The linear programme
    is not compiled, so it is solved between two calls that are.
    """
    if state.payoffs is None or plan.opponents.scheme == "gated":
        return None
    counts = [int(_archive(side).count) for side in (state.pursuer, state.evader)]
    pursuers, evaders = payoffs.meta_strategies(plan.opponents, state.payoffs, *counts)
    return jnp.asarray(pursuers), jnp.asarray(evaders)


@functools.partial(jax.jit, static_argnames="plan", donate_argnames="state")
def admit(plan: Plan, game: Game, state: TrainState) -> TrainState:
    """New versions in both archives, where they are due. Where a scheme asks for it, all versions then have played each
    other, and with `gated` one that is not enough better than its predecessor does not stay.
    """
    config = plan.opponents
    interval = max(1, config.entrants * plan.stage.env_steps // config.versions)
    since = plan.sitting * plan.learner.games
    due = state.env_steps // interval > (state.env_steps - since) // interval
    pursuer, evader = _enter(plan, state.pursuer, due), _enter(plan, state.evader, due)
    if state.payoffs is None:
        return replace(state, pursuer=pursuer, evader=evader)
    chasing, fleeing = _archive(pursuer), _archive(evader)
    key = jax.random.fold_in(state.key, 3)
    table = payoffs.play_missing(state.payoffs, game, chasing, fleeing, config.payoff_games, key)
    if plan.across is not None:
        table = jax.lax.pmean(table, plan.across)
    if config.scheme == "gated":
        pursuers, evaders = (_archive(side).count for side in (state.pursuer, state.evader))

        def gated(archive: opponents.Archive, before: Int[Array, ""], gain: Scalar) -> opponents.Archive:
            return opponents.withdraw(archive, (archive.count > before) & (gain < config.margin))

        chasing = gated(chasing, pursuers, payoffs.improvement(table, pursuers, evaders))
        fleeing = gated(fleeing, evaders, payoffs.improvement(-table.T, evaders, pursuers))
        table = jnp.where(payoffs.present(chasing, fleeing), table, jnp.nan)
    return replace(
        state,
        pursuer=replace(pursuer, archive=chasing),
        evader=replace(evader, archive=fleeing),
        payoffs=table,
    )


def _enter(plan: Plan, side: Learning | None, due: Bool[Array, ""]) -> Learning:
    """A side whose learner, and whose exploiter if it has one, has entered its archive where that is due. The exploiter
    then begins anew, as a copy of the learner.
    """
    assert side is not None, "both sides learn"
    archive = opponents.enter(_archive(side), side.learner.average, due)
    if side.exploiter is None:
        return replace(side, archive=archive)
    archive = opponents.enter(archive, side.exploiter.average, due)
    fresh = algorithm_of(plan.learner).branch(side.learner)
    exploiter = jax.tree.map(lambda new, old: jnp.where(due, new, old), fresh, side.exploiter)
    return replace(side, archive=archive, exploiter=exploiter)


@functools.partial(jax.jit, static_argnames="plan", donate_argnames="state")
def reseat(plan: Plan, game: Game, state: TrainState, mixtures: tuple[Mixture, Mixture] | None) -> TrainState:
    """Who sits is drawn anew, and the games of seats begin anew."""
    config = plan.opponents
    start_key, *keys = jax.random.split(jax.random.fold_in(jax.random.fold_in(state.key, 2), state.iterations), 3)
    seated = has_seat(config, plan.learner.games)
    fresh = reset_batch(game, start_key, plan.learner.games)

    def renewed(side: Learning | None, key: PRNGKeyArray, mixture: Mixture | None) -> Learning:
        assert side is not None, "both sides learn"
        return replace(
            side,
            replay=cut(side.replay, seated),
            archive=opponents.renew(_archive(side), config, key, mixture),
        )

    words = jax.random.bits(jax.random.fold_in(start_key, 1), (2, plan.learner.games), jnp.uint32)
    players = ROLES.map(lambda role: fresh_player(state.games.sides[role].member, words[role], plan.stage.disturbance))
    games = jax.vmap(anew)(seated, Games(fresh, players), state.games)
    chasing, fleeing = mixtures or (None, None)
    return replace(
        state,
        games=games,
        pursuer=renewed(state.pursuer, keys[0], chasing),
        evader=renewed(state.evader, keys[1], fleeing),
    )


def _archive(side: Learning | None) -> opponents.Archive:
    assert side is not None, "both sides learn"
    assert side.archive is not None, "both have archives"
    return side.archive
