"""Names of the games that need no file, known without JAX (`apollonius.game.presets`)."""

import re

PRESETS = ("paper", "four-small", "one-large", "zero-sum", "robot", "territory", "lidar", "blind")
TEAM = re.compile(r"team-(\d{1,4})v(\d{1,4})", re.ASCII)
"""Name of a game of teams, by the numbers of pursuers and evaders."""
