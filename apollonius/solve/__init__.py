"""Ground truth: the game solved by dynamic programming on a grid, with the very same rules."""
