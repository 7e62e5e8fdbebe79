"""One self-play on several devices, or on several hosts: each has its share of the games, and they learn as one.

Every device plays and remembers its own games and draws its own batches. All take the same step, that of the mean of
their gradients, so that their networks stay the same; what is counted over games is added up. With `jax.distributed`
the devices may be those of several processes or hosts, each of which calls the same functions.
"""

import functools
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import jax
import numpy as np
from jax.sharding import Mesh, PartitionSpec
from jaxtyping import PRNGKeyArray

from apollonius.agents.network import Network
from apollonius.errors import require
from apollonius.game.game import Game
from apollonius.learn import opponents
from apollonius.learn.config import SelfPlayConfig
from apollonius.learn.renewal import admit, mixtures_of, reseat
from apollonius.learn.self_play import start_self_play
from apollonius.learn.stage import Metrics, play_and_learn
from apollonius.learn.state import DEVICES, Learning, Plan, TrainState

T = TypeVar("T")
_EACH, _ALL = PartitionSpec(DEVICES), PartitionSpec()
_SHARES = ("games", "batch", "env_steps_per_update", "replay_capacity", "learning_starts", "target_period")
"""What of a stage is counted in games, transitions or env steps, and shared out between devices."""


def all_devices() -> Mesh:
    """The devices of all processes in a row."""
    return Mesh(np.array(jax.devices()), (DEVICES,))


def share(plan: Plan, devices: int) -> Plan:
    """One device's share of a stage: as many updates of as many transitions in all, with 1 / devices of the games.

    Raises:
        InvalidInput: when a number cannot be shared out evenly.
    """
    shared_out = [name for name in _SHARES if hasattr(plan.learner, name)]
    for name in shared_out:
        value = getattr(plan.learner, name)
        require(value % devices == 0, name, value, f"a multiple of {devices} devices")
    assert isinstance(plan.stage, SelfPlayConfig), "both sides learn"
    past = plan.stage.opponents
    own = replace(plan.learner, **{name: getattr(plan.learner, name) // devices for name in shared_out})
    enough = past.share == 0 or int(past.share * own.games) >= 2 * past.seats
    require(
        enough, "games", plan.learner.games, f"more, so that {past.scheme} has games for its seats on {devices} devices"
    )
    rarer = replace(past, renewal=max(1, past.renewal // devices))
    stage = replace(plan.stage, env_steps=-(-plan.stage.env_steps // devices), opponents=rarer)
    return Plan(own, stage, devices)


@functools.partial(jax.jit, static_argnames=("mesh", "plan"))
def start_shared(mesh: Mesh, plan: Plan, game: Game, key: PRNGKeyArray, pursuer: Network | None) -> TrainState:
    """The state before the first step: that of every device, on a leading axis. Arguments as `start_self_play`, the
    plan being one device's share.
    """

    def one(game: Game, key: PRNGKeyArray, pursuer: Network | None) -> TrainState:
        return _with_axis(start_self_play(plan, game, key, pursuer, jax.lax.axis_index(DEVICES)))

    return _on(mesh, one, (_ALL, _ALL, _ALL), _EACH)(game, key, pursuer)


@functools.partial(jax.jit, static_argnames=("mesh", "plan"), donate_argnames="state")
def play_and_learn_shared(mesh: Mesh, plan: Plan, game: Game, state: TrainState) -> tuple[TrainState, Metrics]:
    """One chunk of a stage on every device, and the sums over all of them. The state is consumed."""

    def one(game: Game, state: TrainState) -> tuple[TrainState, Metrics]:
        before = _without_axis(state)
        own, metrics = play_and_learn(plan, game, before, None, None)
        own = replace(own, pursuer=_added_up(before.pursuer, own.pursuer), evader=_added_up(before.evader, own.evader))
        summed = jax.lax.psum((metrics.outcomes, metrics.pursuer_return, metrics.evader_return), DEVICES)
        outcomes, pursuer_return, evader_return = summed
        return _with_axis(own), replace(
            metrics, outcomes=outcomes, pursuer_return=pursuer_return, evader_return=evader_return
        )

    return _on(mesh, one, (_ALL, _EACH), (_EACH, _ALL))(game, state)


def _added_up(before: Learning | None, after: Learning | None) -> Learning:
    """A side whose archive counts the games of all devices, whoever sits where."""
    assert before is not None, "both sides learn"
    assert after is not None, "both sides learn"
    if before.archive is None or after.archive is None:
        return after
    return replace(after, archive=opponents.added_up(before.archive, after.archive, DEVICES))


def renew_opponents_shared(mesh: Mesh, plan: Plan, game: Game, state: TrainState) -> TrainState:
    """`renew_opponents` on every device: the same versions enter, each draws its own seats. The state is consumed."""
    state = _admit_shared(mesh, plan, game, state)
    return _reseat_shared(mesh, plan, game, state, mixtures_of(plan, own_share(state)))


@functools.partial(jax.jit, static_argnames=("mesh", "plan"), donate_argnames="state")
def _admit_shared(mesh: Mesh, plan: Plan, game: Game, state: TrainState) -> TrainState:
    def one(game: Game, state: TrainState) -> TrainState:
        return _with_axis(admit(plan, game, _without_axis(state)))

    return _on(mesh, one, (_ALL, _EACH), _EACH)(game, state)


@functools.partial(jax.jit, static_argnames=("mesh", "plan"), donate_argnames="state")
def _reseat_shared(mesh: Mesh, plan: Plan, game: Game, state: TrainState, mixtures: Any) -> TrainState:
    def one(game: Game, state: TrainState, mixtures: Any) -> TrainState:
        return _with_axis(reseat(plan, game, _without_axis(state), mixtures))

    return _on(mesh, one, (_ALL, _EACH, _ALL), _EACH)(game, state, mixtures)


def own_share(state: TrainState) -> TrainState:
    """The state of this process's first device. Its networks are those of all."""
    return jax.tree.map(lambda leaf: leaf.addressable_shards[0].data[0], state)


def _on(mesh: Mesh, one: Callable[..., Any], inward: Any, outward: Any) -> Callable[..., Any]:
    return jax.shard_map(one, mesh=mesh, in_specs=inward, out_specs=outward, check_vma=False)


def _with_axis(tree: T) -> T:
    return jax.tree.map(lambda leaf: leaf[None], tree)


def _without_axis(tree: T) -> T:
    return jax.tree.map(lambda leaf: leaf[0], tree)
