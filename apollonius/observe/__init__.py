"""What a robot sees: a view of the game in its own units, and the observations that networks read, one file each."""
