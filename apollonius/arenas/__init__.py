"""Arenas and games as files: TOML, ROS maps, random ones, a gallery, a suite; and what a survey of one shows."""
