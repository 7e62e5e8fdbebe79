"""Colours by meaning, the same in all pictures, and far apart for colour-blind readers too."""

PURSUER = "#c8442d"
EVADER = "#2b6ca3"
OBSTACLE = "#8d8d86"
INK = "#2c2c2a"
PAPER = "#ffffff"
OTHER = "#b98a2f"
"""A third colour, for what is neither side's."""
