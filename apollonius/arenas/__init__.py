"""Arenas and games as files: TOML, ROS maps, a gallery, suites, generators, charts, surveys."""
