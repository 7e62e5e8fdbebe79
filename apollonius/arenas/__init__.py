"""Arenas and games as files: TOML, JSON, ROS maps, a gallery, suites, generators, charts and surveys."""
