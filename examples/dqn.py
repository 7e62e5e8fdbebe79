"""A pursuer learns by DQN from Gymnasium's vector interface alone: one file, no training code of the package.

    python examples/dqn.py --env-steps 500000 --out chaser.safetensors
    apollonius evaluate chaser.safetensors still --games 2000

Double Q-learning in the plain shape of CleanRL's single files: a NumPy replay, and one update of the network for each
step of all games. What it shows beyond them is the one thing to get right with an environment that begins ended games
again in the same step: a target looks at `infos["final_obs"]`, not at the new game, and only `terminated` ends it.
"""

import argparse
import sys
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax

import apollonius
from apollonius.agents.network import make_network
from apollonius.agents.store import describe
from apollonius.arenas.record import to_dict
from apollonius.envs.vector import ManyGames
from apollonius.io.errors import exit_status, require

GAMES, BATCH, REPLAY, STARTS, GAMMA, TARGET_PERIOD = 64, 256, 100_000, 5_000, 0.99, 500


def main(arguments: list[str] | None = None) -> int:
    """Train, and write the agent."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--env-steps", type=int, default=500_000)
    parser.add_argument("--opponent", default="still")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("chaser.safetensors"))
    options = parser.parse_args(arguments)
    bound = f"at least {STARTS + GAMES}: learning begins after {STARTS}"
    require(STARTS + GAMES <= options.env_steps < 2**31, "--env-steps", options.env_steps, bound)
    require(0 <= options.seed < 2**32, "--seed", options.seed, "between 0 and 2^32 - 1")
    require(options.out.suffix == ".safetensors", "--out", options.out, "a file that ends in .safetensors")
    envs = ManyGames(apollonius.Role.PURSUER, GAMES, opponent=options.opponent)
    options.out.parent.mkdir(parents=True, exist_ok=True)

    rng = np.random.default_rng(options.seed)
    network = make_network("encoded", width=128, depth=3, key=jax.random.key(options.seed))
    target = network
    optimiser = optax.adam(optax.cosine_decay_schedule(1e-3, options.env_steps // GAMES))
    moments = optimiser.init(eqx.filter(network, eqx.is_array))
    best = eqx.filter_jit(lambda network, seen: jnp.argmax(network.batch(seen), axis=1))

    @eqx.filter_jit
    def update(network, target, moments, seen, action, reward, after, terminated):
        next_action = jnp.argmax(network.batch(after), axis=1)
        next_value = jnp.take_along_axis(target.batch(after), next_action[:, None], axis=1)[:, 0]
        goal = reward + GAMMA * (1 - terminated) * next_value

        def loss_of(network):
            value = jnp.take_along_axis(network.batch(seen), action[:, None], axis=1)[:, 0]
            return jnp.mean(optax.huber_loss(value, goal))

        loss, slope = eqx.filter_value_and_grad(loss_of)(network)
        steps, moments = optimiser.update(slope, moments)
        return eqx.apply_updates(network, steps), moments, loss

    size = envs.single_observation_space.shape[0]
    replay = [np.zeros((REPLAY, *rest), np.float32) for rest in ((size,), (), (), (size,), ())]
    ended, captured, losses = 0, 0, []
    seen, _ = envs.reset(seed=options.seed)
    for step in range(options.env_steps // GAMES):
        epsilon = max(0.05, 1 - step * GAMES / (0.3 * options.env_steps))
        action = np.where(rng.random(GAMES) < epsilon, rng.integers(9, size=GAMES), np.asarray(best(network, seen)))
        new_seen, reward, terminated, truncated, infos = envs.step(action)
        led_to = infos.get("final_obs", new_seen)
        rows = np.arange(step * GAMES, (step + 1) * GAMES) % REPLAY
        for column, new in zip(replay, (seen, action, reward, led_to, terminated), strict=True):
            column[rows] = new
        seen = new_seen
        if infos:
            ended += int((terminated | truncated).sum())
            captured += int((infos["final_info"]["outcome"] == apollonius.Outcome.CAPTURED).sum())
        stored = (step + 1) * GAMES
        if stored >= STARTS:
            chosen = rng.integers(min(stored, REPLAY), size=BATCH)
            batch = [column[chosen] for column in replay]
            batch[1] = batch[1].astype(np.int32)
            network, moments, loss = update(network, target, moments, *batch)
            losses.append(float(loss))
        if step % TARGET_PERIOD == 0:
            target = network
        if losses and (ended >= 1000 or stored > options.env_steps - GAMES):
            rate = captured / max(ended, 1)
            print(f"{stored:>9,} env steps  {rate:6.1%} captured  loss {np.mean(losses):.3f}", flush=True)
            ended, captured, losses = 0, 0, []

    training = {"command": "examples/dqn.py", "env_steps": options.env_steps, "seed": options.seed}
    game = to_dict(apollonius.make_game("paper"))
    apollonius.save_agent(describe(network, apollonius.Role.PURSUER, game, training), options.out)
    print(f"the agent is {options.out}; next: apollonius evaluate {options.out} still --games 2000")
    return 0


if __name__ == "__main__":
    sys.exit(exit_status(main))
