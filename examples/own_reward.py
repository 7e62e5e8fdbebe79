"""Pay for something else: a reward of your own, here the game's own less what driving fast costs.

    pip install -e '.[gym]'
    python examples/own_reward.py

Pursuers that steer alike but drive at different top speeds play in one vector environment. It
prints the mean reward of a game for each pursuer, by either reward:

    top speed [m/s]    0.3    0.5    0.7    0.9    1.1
    the game's own    17.0   17.5   17.0   17.7   15.3
    thrifty           14.6   13.2   10.6    8.3    4.6
"""

import gymnasium
import jax.numpy as jnp
import numpy as np

PRICE = 0.2
TOP_SPEEDS = np.array([0.3, 0.5, 0.7, 0.9, 1.1])


def thrifty(before, timestep):
    """Return the game's reward less a price of the speed squared.

    A reward is a function of the state before a step and of the step.
    """
    return timestep.reward.pursuer - PRICE * before.pursuer.v**2


def dashboard(view):
    """Return the own speed [m/s] and the opponent's bearing [rad].

    An observation is a function of a view to a row of numbers.
    """
    own, other = view.own.state, view.opponent.state
    bearing = jnp.arctan2(other.y - own.y, other.x - own.x) - own.heading
    return jnp.stack([own.v, jnp.arctan2(jnp.sin(bearing), jnp.cos(bearing))])


def mean_rewards(reward, games: int) -> np.ndarray:
    """Return the mean reward of a game for each top speed."""
    envs = gymnasium.make_vec(
        "apollonius.envs.gymnasium:apollonius/Pursuit-v0",
        num_envs=games * len(TOP_SPEEDS),
        vectorization_mode="vector_entry_point",
        opponent="still",
        observation=dashboard,
        reward=reward,
    )
    limits = np.tile(TOP_SPEEDS, games)
    observations, _ = envs.reset(seed=0)
    total = np.zeros(envs.num_envs)
    is_over = np.zeros(envs.num_envs, bool)
    while not is_over.all():
        speed, bearing = observations.T
        throttle = np.where(speed < limits, 6, 0)  # speed up, or brake
        turn = 1 + np.sign(bearing) * (np.abs(bearing) > 0.1)  # right, straight, left
        observations, rewards, terminated, truncated, _ = envs.step((throttle + turn).astype(int))
        total += np.where(is_over, 0.0, rewards)
        is_over |= terminated | truncated
    return total.reshape(games, len(TOP_SPEEDS)).mean(axis=0)


def main(games: int = 500) -> None:
    """Compare the game's own reward and the thrifty one."""
    print("top speed [m/s]", " ".join(f"{speed:6.1f}" for speed in TOP_SPEEDS))
    for name, reward in (("the game's own", None), ("thrifty", thrifty)):
        earned = " ".join(f"{number:6.1f}" for number in mean_rewards(reward, games))
        print(f"{name:15} {earned}")


if __name__ == "__main__":
    main()
