"""Proximal policy optimisation in one file of JAX, for `time_to_96.py` (Schulman et al., 2017): 512
games at a time.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

import apollonius

GAMES, STEPS = 512, 32
EPOCHS, BATCHES = 4, 8
LEARNING_RATE = 1e-3
GAMMA = 0.99
LAMBDA = 0.95
CLIP = 0.2
ENTROPY = 0.01
SCALE = 0.1
"""Of rewards: a game then pays about two."""
HIDDEN = 96
LAYERS = 3
ACTIONS = 9
BRAKE = jnp.int32(1)
"""Action of the evader."""


class Actor(eqx.Module):
    """The policy and the value, networks of their own."""

    policy: eqx.nn.MLP
    value: eqx.nn.MLP


class Steps(NamedTuple):
    """Steps of all games, or a batch; leaves begin with [steps, games] or [batch]."""

    observations: Float[Array, "... size"]
    action: Int[Array, "..."]
    log_probability: Float[Array, "..."]
    value: Float[Array, "..."]
    reward: Float[Array, "..."]
    over: Bool[Array, "..."]


def make_actor(size: int, key: PRNGKeyArray) -> Actor:
    """Return random networks for observations of this size."""
    policy_key, value_key = jax.random.split(key)
    policy = eqx.nn.MLP(size, ACTIONS, HIDDEN, LAYERS, activation=jnp.tanh, key=policy_key)
    value = eqx.nn.MLP(size, "scalar", HIDDEN, LAYERS, activation=jnp.tanh, key=value_key)
    return Actor(policy, value)


def log_probabilities(
    actor: Actor, observations: Float[Array, "batch size"]
) -> Float[Array, "batch actions"]:
    """Return the logarithms of the probabilities of all actions."""
    return jax.nn.log_softmax(jax.vmap(actor.policy)(observations))


def advantages(steps: Steps, last_value: Float[Array, " games"]) -> Float[Array, "steps games"]:
    """Estimate advantages (Schulman et al., "Generalized advantage estimation", 2016)."""

    def one_step(carry: Any, step: Steps) -> Any:
        later, next_value = carry
        goes_on = 1.0 - step.over
        error = step.reward + GAMMA * goes_on * next_value - step.value
        advantage = error + GAMMA * LAMBDA * goes_on * later
        return (advantage, step.value), advantage

    first = jnp.zeros_like(last_value), last_value
    return jax.lax.scan(one_step, first, steps, reverse=True)[1]


def loss(
    actor: Actor, steps: Steps, advantage: Float[Array, " batch"], target: Float[Array, " batch"]
) -> Array:
    """Return the clipped surrogate objective, the squared error of values and the entropy,
    weighted.
    """
    logarithms = log_probabilities(actor, steps.observations)
    log_probability = jnp.take_along_axis(logarithms, steps.action[:, None], axis=1)[:, 0]
    ratio = jnp.exp(log_probability - steps.log_probability)
    normalised_advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    clipped = jnp.clip(ratio, 1 - CLIP, 1 + CLIP)
    surrogate = jnp.minimum(ratio * normalised_advantage, clipped * normalised_advantage).mean()
    error = ((jax.vmap(actor.value)(steps.observations) - target) ** 2).mean()
    entropy = -(jnp.exp(logarithms) * logarithms).sum(axis=1).mean()
    return 0.5 * error - surrogate - ENTROPY * entropy


def train(game: apollonius.Game, observe: Callable[[Any], Array], seed: int, watch: Any) -> None:
    """Train until the watch says stop."""
    actor_key, start_key, key = jax.random.split(jax.random.key(seed), 3)
    games, step_games = apollonius.autoreset(game, start_key, GAMES)
    look = jax.vmap(observe)
    weights, functions = eqx.partition(
        make_actor(look(games.state).shape[1], actor_key), eqx.is_array
    )
    optimiser = optax.chain(optax.clip_by_global_norm(0.5), optax.adam(LEARNING_RATE, eps=1e-5))
    moments = optimiser.init(weights)

    def play(actor: Actor, games: Any, key: PRNGKeyArray) -> tuple[Any, Steps]:
        def one_step(games: Any, key: PRNGKeyArray) -> tuple[Any, Steps]:
            observations = look(games.state)
            logarithms = log_probabilities(actor, observations)
            action = jax.random.categorical(key, logarithms)
            log_probability = jnp.take_along_axis(logarithms, action[:, None], axis=1)[:, 0]
            value = jax.vmap(actor.value)(observations)
            games, timestep = step_games(games, (action, BRAKE))
            over = timestep.terminated | timestep.truncated
            return games, Steps(
                observations, action, log_probability, value, SCALE * timestep.reward.pursuer, over
            )

        return jax.lax.scan(one_step, games, jax.random.split(key, STEPS))

    def learn(carry: Any, batch: Any) -> tuple[Any, None]:
        weights, moments = carry
        gradient = eqx.filter_grad(loss)(eqx.combine(weights, functions), *batch)
        change, moments = optimiser.update(gradient, moments)
        return (optax.apply_updates(weights, change), moments), None

    @jax.jit
    def iterate(weights: Any, moments: Any, games: Any, key: PRNGKeyArray) -> Any:
        actor = eqx.combine(weights, functions)
        play_key, *epoch_keys = jax.random.split(key, 1 + EPOCHS)
        games, steps = play(actor, games, play_key)
        advantage = advantages(steps, jax.vmap(actor.value)(look(games.state)))
        whole = (steps, advantage, advantage + steps.value)
        flat = jax.tree.map(lambda leaf: leaf.reshape(STEPS * GAMES, *leaf.shape[2:]), whole)

        def epoch(carry: Any, key: PRNGKeyArray) -> tuple[Any, None]:
            order = jax.random.permutation(key, STEPS * GAMES).reshape(BATCHES, -1)
            return jax.lax.scan(learn, carry, jax.tree.map(lambda leaf: leaf[order], flat))

        (weights, moments), _ = jax.lax.scan(epoch, (weights, moments), jnp.stack(epoch_keys))
        return weights, moments, games

    iteration = 0
    while True:
        iteration += 1
        weights, moments, games = iterate(
            weights, moments, games, jax.random.fold_in(key, iteration)
        )
        jax.block_until_ready(weights)
        layers = weights.policy.layers
        network = "tanh", [(layer.weight, layer.bias) for layer in layers]
        if watch(iteration * GAMES * STEPS, network):
            return
