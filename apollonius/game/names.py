"""Names of the games that need no file, which are known without JAX; what they are says `apollonius.game.presets`."""

import re

PRESETS = ("paper", "four-small", "one-large", "zero-sum", "robot", "territory")
TEAM = re.compile(r"team-(\d{1,4})v(\d{1,4})", re.ASCII)
"""What games of teams are called: by how many pursuers and evaders they have."""
