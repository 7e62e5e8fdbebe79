"""Ground truth by dynamic programming: safety, the least time to a target, the game of two."""
