"""Sweep a number of the game in one call: 1,000 games, a hundred for each turn rate.

    python examples/sweep.py

A sweep is a `vmap`. The rule `intercept` chases the rule `flee-aware`. It prints:

    0.2 rad/s:   2% captured
    0.4 rad/s:  28% captured
    0.6 rad/s:  49% captured
    0.8 rad/s:  52% captured
    1.0 rad/s:  64% captured
    1.2 rad/s:  69% captured
    1.4 rad/s:  66% captured
    1.6 rad/s:  68% captured
    1.8 rad/s:  68% captured
    2.0 rad/s:  69% captured
"""

from dataclasses import replace

import jax
import jax.numpy as jnp

import apollonius

GAME = apollonius.make_game("paper")
BITS = jnp.uint32(0)  # neither rule is random


def outcome_of(turn_rate: jax.Array, key: jax.Array) -> jax.Array:
    """Return the `Outcome` of one game whose pursuer turns at this rate [rad/s] at most."""
    game = replace(GAME, pursuer=replace(GAME.pursuer, u2_max=turn_rate))
    pursuer = apollonius.find_player("intercept", apollonius.Role.PURSUER, game).policy
    evader = apollonius.find_player("flee-aware", apollonius.Role.EVADER, game).policy

    def is_under_way(carry):
        _, outcome = carry
        return outcome == apollonius.Outcome.ONGOING

    def one_step(carry):
        state, _ = carry
        red, _ = pursuer(apollonius.look(game, state, apollonius.Role.PURSUER), (), BITS)
        blue, _ = evader(apollonius.look(game, state, apollonius.Role.EVADER), (), BITS)
        timestep = game.step(state, red, blue)
        return timestep.state, timestep.outcome

    begin = game.reset(key), jnp.int32(apollonius.Outcome.ONGOING)
    return jax.lax.while_loop(is_under_way, one_step, begin)[1]


def main(games: int = 1000, values: int = 10) -> None:
    """Play the games in one call, the same number with each value."""
    turn_rates = jnp.linspace(0.2, 2.0, values)
    keys = jax.random.split(jax.random.key(0), games // values)  # the same starts for each value
    of_starts = jax.vmap(outcome_of, in_axes=(None, 0))
    outcomes = jax.jit(jax.vmap(of_starts, in_axes=(0, None)))(turn_rates, keys)

    shares = (outcomes == apollonius.Outcome.CAPTURED).mean(axis=1)
    for turn_rate, share in zip(turn_rates, shares, strict=True):
        print(f"{turn_rate:.1f} rad/s: {share:4.0%} captured")


if __name__ == "__main__":
    main()
