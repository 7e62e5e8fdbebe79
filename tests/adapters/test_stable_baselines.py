"""Stable-Baselines3's algorithms train on the Gymnasium interface, where it is installed: it is in no extra."""

import gymnasium
import numpy as np
import pytest

import apollonius.adapters.gymnasium  # noqa: F401 (registers the names)

stable_baselines3 = pytest.importorskip("stable_baselines3")


@pytest.mark.parametrize(("name", "opponent"), [("Pursuit", "still"), ("Evasion", "random")])
def test_its_dqn_learns_from_games(name, opponent):
    env = gymnasium.make(f"apollonius/{name}-v0", opponent=opponent)
    learner = stable_baselines3.DQN(
        "MlpPolicy", env, learning_starts=200, train_freq=8, buffer_size=2_000, policy_kwargs={"net_arch": [32]}, seed=0
    )
    before = [parameter.detach().clone() for parameter in learner.q_net.parameters()]
    learner.learn(total_timesteps=1_000)
    after = list(learner.q_net.parameters())
    assert any((one != two).any() for one, two in zip(before, after, strict=True))
    assert all(bool(parameter.isfinite().all()) for parameter in after)
    buffer = learner.replay_buffer
    observations = buffer.observations[: buffer.pos]
    assert observations.shape[-1] == 17
    assert np.all(np.abs(observations) <= 2)
    assert buffer.dones[: buffer.pos].sum() > 0
    observation, _ = env.reset(seed=3)
    action, _ = learner.predict(observation, deterministic=True)
    assert env.action_space.contains(int(action))
    assert env.step(int(action))[0].shape == (17,)


@pytest.mark.parametrize("algorithm", ["PPO", "SAC"])
def test_its_algorithms_for_continuous_actions_learn_from_games(algorithm):
    env = gymnasium.make("apollonius/Pursuit-v0", opponent="still", actions="continuous")
    options = {"PPO": {"n_steps": 256}, "SAC": {"learning_starts": 200, "train_freq": 8, "buffer_size": 2_000}}
    learner = getattr(stable_baselines3, algorithm)(
        "MlpPolicy", env, policy_kwargs={"net_arch": [32]}, seed=0, **options[algorithm]
    )
    before = [parameter.detach().clone() for parameter in learner.policy.parameters()]
    learner.learn(total_timesteps=1_000)
    after = list(learner.policy.parameters())
    assert any((one != two).any() for one, two in zip(before, after, strict=True))
    assert all(bool(parameter.isfinite().all()) for parameter in after)
    observation, _ = env.reset(seed=3)
    action, _ = learner.predict(observation, deterministic=True)
    assert env.action_space.contains(action)
    assert env.step(action)[0].shape == (17,)
