"""A ROS 2 node that drives one robot of a pursuit-evasion game by an exported player."""
