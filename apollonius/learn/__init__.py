"""Training: DQN and soft actor-critic, the two stages of the curriculum, checkpoints. Never judges."""
