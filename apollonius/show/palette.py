"""Colours by meaning, the same in all pictures, and far apart for colour-blind readers too."""

PURSUER = "#c4402a"
EVADER = "#2b6ca3"
SIDES = (PURSUER, EVADER)
OBSTACLE = "#8d8d86"
INK = "#2c2c2a"
PAPER = "#ffffff"
OTHER = "#5a1846"
"""A third colour, for what is neither side's."""
GRID = "#e4e4df"

LIGHT = {
    "pursuer": PURSUER,
    "evader": EVADER,
    "obstacle": OBSTACLE,
    "ink": INK,
    "paper": PAPER,
    "other": OTHER,
    "grid": GRID,
    "quiet": "#5d5d58",
    "panel": "#f6f6f3",
}
"""The colours of a page by name; `quiet` is for words of less weight, `panel` for what lies on the
paper.
"""

DARK = {
    "pursuer": "#ff8d76",
    "evader": "#7fbaf0",
    "obstacle": "#85857f",
    "ink": "#ecece6",
    "paper": "#17181a",
    "other": "#f2e14c",
    "grid": "#35373a",
    "quiet": "#adada6",
    "panel": "#212326",
}
"""The same where a reader prefers dark pages."""
