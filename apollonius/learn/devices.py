"""One training on several devices, or on several hosts: each has its share of the games, and they learn as one.

Every device plays and remembers its own games and draws its own batches. All take the same step, that of the mean of
their gradients, so that their networks stay the same; what is counted over games is added up. Their states lie side by
side on a leading axis. With `jax.distributed` the devices may be those of several processes or hosts, each of which
calls the same functions.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental import multihost_utils
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import Array, Int

from apollonius.errors import require
from apollonius.learn.opponents.seats import seat_games
from apollonius.learn.stage_config import SelfPlayConfig
from apollonius.learn.train_state import DEVICE_AXIS, Plan

T = TypeVar("T")
_EACH, _ALL = PartitionSpec(DEVICE_AXIS), PartitionSpec()
_SHARES = ("games", "batch", "env_steps_per_update", "replay_capacity", "learning_starts", "target_period")
"""What of a stage is counted in games, transitions or env steps, and shared out between devices."""


def share(plan: Plan, devices: int) -> Plan:
    """One device's share of a stage: as many updates of as many transitions in all, with 1 / devices of the games.

    Raises:
        InvalidInput: when there are not so many devices, or a number cannot be shared out evenly.
    """
    if devices == 1:
        return plan
    there = len(jax.devices())
    require(devices <= there, "devices", devices, f"at most {there}, as there are here")
    shared_out = [name for name in _SHARES if hasattr(plan.learner, name)]
    for name in shared_out:
        value = getattr(plan.learner, name)
        require(value % devices == 0, name, value, f"a multiple of {devices} devices")
    own = replace(plan.learner, **{name: getattr(plan.learner, name) // devices for name in shared_out})
    stage = replace(plan.stage, env_steps=-(-plan.stage.env_steps // devices))
    if isinstance(stage, SelfPlayConfig):
        past = stage.opponents
        enough = past.share == 0 or seat_games(past, own.games) > 0
        bound = f"more, so that {past.scheme} has games for its seats on {devices} devices"
        require(enough, "games", plan.learner.games, bound)
        stage = replace(stage, opponents=replace(past, renewal=max(1, past.renewal // devices)))
    return Plan(own, stage, devices)


def on_each(plan: Plan, function: Callable[..., Any], gives_sums: bool = False) -> Callable[..., Any]:
    """A function of one device's state and of what all devices share, called on every device.

    Args:
        function: its first argument is the state, and it returns a state.
        gives_sums: whether it returns, besides, what is the same on all devices.
    """
    if plan.across is None:
        return function

    def one(state: Any, *shared: Any) -> Any:
        given = function(_without_axis(state), *shared)
        return (_with_axis(given[0]), given[1]) if gives_sums else _with_axis(given)

    def call(state: Any, *shared: Any) -> Any:
        inward, outward = (_EACH, *[_ALL] * len(shared)), (_EACH, _ALL) if gives_sums else _EACH
        return jax.shard_map(one, mesh=_mesh(plan), in_specs=inward, out_specs=outward, check_vma=False)(state, *shared)

    return call


def begun(plan: Plan, start: Callable[[Int[Array, ""] | None], T]) -> T:
    """The state that a stage starts with on every device.

    Args:
        start: makes the state of a device from its number; None where there is only one.
    """
    if plan.across is None:
        return start(None)
    one = jax.shard_map(
        lambda: _with_axis(start(jax.lax.axis_index(DEVICE_AXIS))),
        mesh=_mesh(plan), in_specs=(), out_specs=_EACH, check_vma=False,
    )  # fmt: skip
    return jax.jit(one)()


def own_share(plan: Plan, state: T) -> T:
    """The state of this process's first device. Its networks are those of all."""
    return jax.tree.map(lambda leaf: leaf.addressable_shards[0].data[0], state) if plan.across else state


def gathered(plan: Plan, state: Any) -> Any:
    """The states of all devices where this process can read them, random keys as their numbers; every process calls
    this.
    """

    def numbers(leaf: Any) -> Any:
        return jax.random.key_data(leaf) if jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key) else leaf

    if jax.process_count() == 1:
        return state
    everywhere = NamedSharding(_mesh(plan), _ALL)
    return jax.jit(lambda states: jax.tree.map(numbers, states), out_shardings=everywhere)(state)


def placed(plan: Plan, state: T) -> T:
    """States of all devices, which every process has, each on its own device."""
    if plan.across is None:
        return state
    each = NamedSharding(_mesh(plan), _EACH)

    def place(leaf: Any) -> Any:
        if jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key):
            return jax.random.wrap_key_data(place(jax.random.key_data(leaf)), impl=jax.random.key_impl(leaf))
        numbers = np.asarray(leaf)
        return jax.make_array_from_callback(numbers.shape, each, lambda index: numbers[index])

    return jax.tree.map(place, state)


def agreed(decision: bool) -> bool:
    """What the first process decides, in all of them: they must do the same things in the same order."""
    return decision if jax.process_count() == 1 else bool(multihost_utils.broadcast_one_to_all(np.asarray(decision)))


def _mesh(plan: Plan) -> Mesh:
    """The devices of all processes that share a stage, in a row."""
    return Mesh(np.array(jax.devices()[: plan.devices]), (DEVICE_AXIS,))


def _with_axis(tree: T) -> T:
    return jax.tree.map(lambda leaf: leaf[None], tree)


def _without_axis(tree: T) -> T:
    return jax.tree.map(lambda leaf: leaf[0], tree)
