"""Algorithms 1 and 2 of the paper as printed, in plain JAX: to read with the paper beside it.

    python examples/as_printed.py [steps] [seed]

Comments name the lines of both listings. Where the paper is silent, the numbers are those of
`apollonius train --profile paper`. The random numbers are, too: the weights are the package's, bit
for bit, where XLA fuses no product with a sum (XLA_FLAGS=--xla_cpu_max_isa=AVX).

Every 50,000 steps it prints the share of captures in 200 greedy games. Learning begins after the
first 50,000; two trainings of the package caught 95 % after 1.4 million (docs/benchmarks).
"""

import sys
from collections import namedtuple
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import jax
import jax.numpy as jnp
import optax
from jax.random import fold_in

import apollonius
from apollonius.observe.paper import PAPER

GAME = apollonius.make_game("paper")  # Table I
STAND_STILL = jnp.int32(1)  # brake, straight ahead: robots start at rest
ADAM = optax.adam(1e-4)  # section IV
GAMES = 200  # in a report
STARTS, CHUNK = 4096, 8192  # starts that the package draws at once, and steps until the next draw
reset = jax.jit(apollonius.Game.reset)


class Numbers(NamedTuple):
    """The network of Fig. 3; from `batch` on numbers that the paper leaves open."""

    width: int = 256
    batch: int = 32
    capacity: int = 1_000_000
    learning_starts: int = 50_000
    target_period: int = 30_000  # C
    final_epsilon: float = 0.1
    exploration_steps: int = 500_000
    report_period: int = 50_000


Transitions = namedtuple("Transitions", "s a r s_next last")  # Eq. 3 has no value after the last


def algorithm_1(seed, steps, n):
    """Train the pursuer against an evader that stands still; return its network and the target."""
    game = jax.device_put(replace(GAME, reward=apollonius.Reward(progress=10.0), max_steps=200))
    (weights_p,), start_key, key = first_keys(seed, 0, learners=1)
    D_p = empty_buffer(n)  # Algorithm 1, line 1
    Q_p = random_weights(weights_p, n)  # Algorithm 1, line 2
    Q_hat_p = Q_p  # Algorithm 1, line 3
    adam_p = ADAM.init(Q_p)
    step = 0
    while step < steps:  # Algorithm 1, line 4: by steps, not by episodes
        state = reset(game, start_key)  # Algorithm 1, line 5
        s_p, _ = observe(game, state)
        over = False
        while not over and step < steps:  # Algorithm 1, line 6
            bits_p, _, key_p, _, start_key = step_keys(key, step)
            a_p = epsilon_greedy(Q_p, s_p, bits_p, 1.0, step, n)  # Algorithm 1, line 7
            state, r_p, _, s_p_next, _, _, over = execute(game, state, a_p, STAND_STILL)
            D_p = store(D_p, step, s_p, a_p, r_p, s_p_next, over)  # Algorithm 1, line 8
            s_p, step = s_p_next, step + 1
            if step >= n.learning_starts:
                batch = sample(D_p, key_p, step, n.batch)  # Algorithm 1, line 9
                Q_p, adam_p = update(Q_p, adam_p, Q_hat_p, batch, n)  # Algorithm 1, line 10
            if step % n.target_period == 0:
                Q_hat_p = Q_p  # Algorithm 1, line 11
            if step % n.report_period == 0:
                print(f"{step:9,} steps: {captures(game, Q_p):6.1%} of standing evaders captured")
    return Q_p, Q_hat_p  # Algorithm 1, line 14


def algorithm_2(seed, steps, n, model=None):
    """Train both sides, the pursuer from a model or from scratch; return networks and targets."""
    game = jax.device_put(replace(GAME, reward=apollonius.Reward(progress=1.0), max_steps=1000))
    (weights_p, weights_e), start_key, key = first_keys(seed, 1, learners=2)
    D_p, D_e = empty_buffer(n), empty_buffer(n)  # Algorithm 2, line 1
    Q_p = Q_hat_p = model or random_weights(weights_p, n)  # Algorithm 2, line 2
    Q_e = random_weights(weights_e, n)  # Algorithm 2, line 3
    Q_hat_e = Q_e  # Algorithm 2, line 4
    adam_p = ADAM.init(Q_p)
    adam_e = ADAM.init(Q_e)
    step = 0
    while step < steps:  # Algorithm 2, line 5: by steps, not by episodes
        state = reset(game, start_key)  # Algorithm 2, line 6
        s_p, s_e = observe(game, state)
        over = False
        while not over and step < steps:  # Algorithm 2, line 7
            bits_p, bits_e, key_p, key_e, start_key = step_keys(key, step)
            a_p = epsilon_greedy(Q_p, s_p, bits_p, 0.2, step, n)  # Algorithm 2, line 8
            a_e = epsilon_greedy(Q_e, s_e, bits_e, 1.0, step, n)
            state, r_p, r_e, s_p_next, s_e_next, last, over = execute(game, state, a_p, a_e)
            D_p = store(D_p, step, s_p, a_p, r_p, s_p_next, last)  # Algorithm 2, line 9
            D_e = store(D_e, step, s_e, a_e, r_e, s_e_next, last)
            s_p, s_e, step = s_p_next, s_e_next, step + 1
            if step >= n.learning_starts:
                batch_p = sample(D_p, key_p, step, n.batch)  # Algorithm 2, line 10
                batch_e = sample(D_e, key_e, step, n.batch)
                Q_p, adam_p = update(Q_p, adam_p, Q_hat_p, batch_p, n)  # Algorithm 2, line 11
                Q_e, adam_e = update(Q_e, adam_e, Q_hat_e, batch_e, n)
            if step % n.target_period == 0:
                Q_hat_p, Q_hat_e = Q_p, Q_e  # Algorithm 2, line 12
            if step % n.report_period == 0:
                print(f"{step:9,} steps: {captures(game, Q_p, Q_e):6.1%} of fleeing ones")
    return (Q_p, Q_e), (Q_hat_p, Q_hat_e)  # Algorithm 2, line 15


@jax.jit
def observe(game, state):
    """Return the observations of both sides (Eq. 7)."""
    return tuple(PAPER(apollonius.look(game, state, role)) for role in apollonius.Role)


@jax.jit
def execute(game, state, a_p, a_e):
    """Return state, rewards, observations, whether the rules end the game, whether it ends."""
    after = game.step(state, a_p, a_e)
    over = after.terminated | after.truncated
    return after.state, *after.reward, *observe(game, after.state), after.terminated, over


def random_weights(key, n):
    """Draw the weight and the bias of each layer of Fig. 3, uniform up to 1 / sqrt(inputs)."""
    sizes = pairwise([PAPER.size, *[n.width] * 4, 9])
    theta = []
    for layer_key, (inputs, outputs) in zip(jax.random.split(key, 5), sizes, strict=True):
        weight_key, bias_key = jax.random.split(layer_key)
        draw = partial(jax.random.uniform, minval=-(inputs**-0.5), maxval=inputs**-0.5)
        theta.append((draw(weight_key, (outputs, inputs)), draw(bias_key, (outputs,))))
    return theta


@partial(jax.vmap, in_axes=(None, 0))
def action_values(theta, s):
    """Return the values of the nine actions (Fig. 3) in each row of observations."""
    for weight, bias in theta[:-1]:
        s = jax.nn.relu(weight @ s + bias)
    weight, bias = theta[-1]
    return weight @ s + bias


@jax.jit
def epsilon_greedy(theta, s, bits, first, step, n):
    """Choose a random action, by the upper half of the bits, or the best one; epsilon falls."""
    epsilon = first + (n.final_epsilon - first) * jnp.clip(step / n.exploration_steps, 0.0, 1.0)
    best = jnp.argmax(action_values(theta, s[None])[0]).astype(jnp.int32)
    explores = (bits & 0xFFFF).astype(jnp.float32) < epsilon * 65536
    return jnp.where(explores, (((bits >> 16) * 9) >> 16).astype(jnp.int32), best)


def empty_buffer(n):
    s, r = jnp.zeros((n.capacity, PAPER.size)), jnp.zeros(n.capacity)
    return Transitions(s, r.astype(jnp.int32), r, jnp.zeros_like(s), r.astype(bool))


@partial(jax.jit, donate_argnums=0)
def store(buffer, step, *transition):
    """Write a transition over the oldest one."""
    pairs = zip(buffer, transition, strict=True)
    return Transitions(*(rows.at[step % len(rows)].set(new) for rows, new in pairs))


@partial(jax.jit, static_argnames="size")
def sample(buffer, key, stored, size):
    """Draw transitions uniformly."""
    filled = jnp.minimum(stored, len(buffer.r))
    rows = (stored + jax.random.randint(key, (size,), 0, filled)) % filled
    return jax.tree.map(lambda leaf: leaf[rows], buffer)


@jax.jit
def update(theta, adam, theta_minus, batch, n):
    """Make one step of Adam on Eq. 3, its mean over a mini-batch; theta_minus is the target's."""
    next_values = jnp.max(action_values(theta_minus, batch.s_next), axis=1)
    target = batch.r + jnp.where(batch.last, 0.0, 0.99) * next_values

    def loss(theta):
        values = jnp.take_along_axis(action_values(theta, batch.s), batch.a[:, None], axis=1)[:, 0]
        return jnp.mean((target - values) ** 2)

    change, adam = ADAM.update(jax.grad(loss)(theta), adam)
    return optax.apply_updates(theta, change), adam


def first_keys(seed, stage, learners):
    """Return the keys of the learners' weights, of the first start, and of the training."""
    *weights, rest = jax.random.split(fold_in(jax.random.key(seed), stage), learners + 1)
    start_key, _, key = jax.random.split(rest, 3)
    return weights, fold_in(start_key, 0), key


@jax.jit
def step_keys(key, step):
    """Return both sides' random bits and keys of mini-batches, and the key of the next start."""
    play_key, *batch_keys = jax.random.split(fold_in(fold_in(key, 1), step), 3)
    bits = jax.random.bits(fold_in(play_key, 0), (2,))
    chunk_key = fold_in(fold_in(key, 0), step // CHUNK * CHUNK)
    start_key = fold_in(chunk_key, step % CHUNK % STARTS)
    return *bits, *(fold_in(fold_in(key, 0), 0) for key in batch_keys), start_key


@jax.jit
def captures(game, Q_p, Q_e=None):
    """Return the share of greedy games of up to 1,000 steps that end with a capture."""
    game = replace(game, max_steps=1000)
    states = apollonius.reset_batch(game, jax.random.key(20_200), GAMES)

    def one_step(_, carry):
        states, outcomes = carry
        s_p, s_e = jax.vmap(partial(observe, game))(states)
        a_p = jnp.argmax(action_values(Q_p, s_p), axis=1)
        a_e = jnp.argmax(action_values(Q_e, s_e), axis=1) if Q_e else jnp.full(GAMES, STAND_STILL)
        after = jax.vmap(game.step)(states, a_p, a_e)
        return after.state, jnp.where(outcomes == 0, after.outcome, outcomes)

    _, outcomes = jax.lax.fori_loop(0, 1000, one_step, (states, jnp.zeros(GAMES, jnp.int32)))
    return jnp.mean(outcomes == apollonius.Outcome.CAPTURED)


def main(steps: int = 400_000, seed: int = 0, **numbers: int) -> None:
    """Train a pursuer by Algorithm 1, then it and an evader by Algorithm 2, each for some steps."""
    n = Numbers(**numbers)
    Q_p, _ = algorithm_1(seed, steps, n)
    algorithm_2(seed, steps, n, model=Q_p)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
