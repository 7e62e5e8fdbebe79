"""Ground truth by dynamic programming on the same rules: safety, the least time to a target, the game of two."""
