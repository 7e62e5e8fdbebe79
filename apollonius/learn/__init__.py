"""Training: DQN, the two stages of the curriculum, checkpoints. Never judges."""
