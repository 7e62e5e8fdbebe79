"""The knowledge of a side, the view of one robot, and the observations that networks read."""
