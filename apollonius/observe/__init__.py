"""A view of the game as one robot has it, and the observations that networks read."""
