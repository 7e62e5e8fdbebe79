"""DQN and soft actor-critic, the stages of training, checkpoints. Never judges."""
