"""Let a network of your own play: an `eqx.nn.MLP` that learns what another player does.

    python examples/own_network.py

It prints how often the network agrees with its teacher, and how both fare against the same evaders:

"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import optax

import apollonius

GAME = apollonius.make_game("paper")
PURSUER = apollonius.Role.PURSUER
OBSERVATION = apollonius.find_observation("encoded")


class Pupil(apollonius.AbstractPolicy):
    """A player that takes the action to which its network gives the highest number."""

    network: eqx.nn.MLP

    @property
    def observation(self):
        return OBSERVATION

    def __call__(self, observations, memory, bits):
        return jnp.argmax(self.network(observations)).astype(jnp.int32), memory


def loss(network, observations, answers):
    """Return the mean cross-entropy of the network and the teacher's answers."""
    return optax.softmax_cross_entropy_with_integer_labels(
        jax.vmap(network)(observations), answers
    ).mean()


def main(states: int = 200_000, updates: int = 3_000, games: int = 1_000, width: int = 128) -> None:
    """Learn from the teacher's actions in random states, then play matches from the same starts."""
    data_key, network_key, batch_key = jax.random.split(jax.random.key(0), 3)
    teacher = apollonius.find_player("P_curriculum", PURSUER, GAME)
    moving = replace(GAME, starts=replace(GAME.starts, speed="moving"))
    drawn = apollonius.reset_batch(moving, data_key, states)
    observations = jax.vmap(lambda state: OBSERVATION(apollonius.look(GAME, state, PURSUER)))(drawn)
    answers = jax.vmap(lambda row: teacher.policy(row, (), jnp.uint32(0))[0])(observations)

    network = eqx.nn.MLP(OBSERVATION.size, 9, width, depth=2, key=network_key)
    optimiser = optax.adam(optax.cosine_decay_schedule(2e-3, updates))
    moments = optimiser.init(eqx.filter(network, eqx.is_array))

    @eqx.filter_jit
    def update(network, moments, key):
        rows = jax.random.randint(key, (1024,), 0, states)
        slope = eqx.filter_grad(loss)(network, observations[rows], answers[rows])
        steps, moments = optimiser.update(slope, moments)
        return eqx.apply_updates(network, steps), moments

    for key in jax.random.split(batch_key, updates):
        network, moments = update(network, moments, key)
    agreement = jnp.argmax(jax.vmap(network)(observations), axis=1) == answers
    print(f"the pupil answers as its teacher in {agreement.mean():.0%} of the states")

    evader = apollonius.find_player("flee", apollonius.Role.EVADER, GAME)
    for pursuer in (teacher, apollonius.NamedPlayer("the pupil", Pupil(network))):
        match = apollonius.Match(GAME, apollonius.BySide(pursuer, evader), games)
        result = apollonius.play_match(match)
        print(f"{pursuer.name} wins {result.pursuer_win_rate:.1%} against {evader.name}")


if __name__ == "__main__":
    main()
