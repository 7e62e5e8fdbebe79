"""DQN, soft actor-critic and PPO, the stages of training, checkpoints. Never judges."""
