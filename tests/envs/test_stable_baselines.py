"""Stable-Baselines3's algorithms train on the Gymnasium interface, where it is installed: `make test-all` does so."""

import gymnasium
import pytest

import apollonius.envs.gymnasium  # noqa: F401 (registers the names)

stable_baselines3 = pytest.importorskip("stable_baselines3")
pytestmark = pytest.mark.slow
OFF_POLICY = {"learning_starts": 200, "train_freq": 8, "buffer_size": 2_000}


@pytest.mark.parametrize(
    ("algorithm", "actions", "options"),
    [("DQN", "discrete", OFF_POLICY), ("PPO", "continuous", {"n_steps": 256}), ("SAC", "continuous", OFF_POLICY)],
)
def test_its_algorithms_learn_from_games(algorithm, actions, options):
    env = gymnasium.make("apollonius/Pursuit-v0", opponent="still", actions=actions)
    made = getattr(stable_baselines3, algorithm)
    learner = made("MlpPolicy", env, policy_kwargs={"net_arch": [32]}, seed=0, **options)
    before = [parameter.detach().clone() for parameter in learner.policy.parameters()]
    learner.learn(total_timesteps=1_000)
    after = list(learner.policy.parameters())
    assert any((one != two).any() for one, two in zip(before, after, strict=True))
    assert all(bool(parameter.isfinite().all()) for parameter in after)
    observation, _ = env.reset(seed=3)
    action, _ = learner.predict(observation, deterministic=True)
    assert env.action_space.contains(action)
