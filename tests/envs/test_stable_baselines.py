"""Stable-Baselines3's algorithms train on the Gymnasium interface, where it is installed: `make test-all` does so."""

import gymnasium
import numpy as np
import pytest

import apollonius.envs.gymnasium  # noqa: F401 (registers the names)

stable_baselines3 = pytest.importorskip("stable_baselines3")
pytestmark = pytest.mark.slow


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


def test_its_processes_and_its_files_take_environments(tmp_path):
    """A game under way is sent to processes that are spawned; a learner is kept with it, and learns on."""
    env = gymnasium.make("apollonius/Pursuit-v0", opponent="still")
    learner = stable_baselines3.DQN(
        "MlpPolicy", env, learning_starts=50, buffer_size=200, policy_kwargs={"net_arch": [8]}, seed=0
    )
    learner.learn(total_timesteps=100)
    processes = stable_baselines3.common.vec_env.SubprocVecEnv([lambda: env] * 2, start_method="spawn")
    try:
        processes.seed(5)
        seen = processes.reset()
        told = [processes.step(np.array([8, 8]))[0] for _ in range(5)]
    finally:
        processes.close()
    for index, seed in enumerate((5, 6)):
        np.testing.assert_array_equal(seen[index], env.reset(seed=seed)[0])
        for step in told:
            np.testing.assert_array_equal(step[index], env.step(8)[0])

    learner.save(tmp_path / "with.zip", include=["env"])
    learner.save(tmp_path / "without.zip")
    for again in (
        stable_baselines3.DQN.load(tmp_path / "with.zip"),
        stable_baselines3.DQN.load(tmp_path / "without.zip", env=env),
    ):
        observation = seen[0]
        assert again.predict(observation, deterministic=True)[0] == learner.predict(observation, deterministic=True)[0]
        again.learn(total_timesteps=100, reset_num_timesteps=False)
        assert again.num_timesteps == 200
