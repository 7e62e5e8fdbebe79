"""What a side knows, the view of one robot, and the observations that networks read."""
