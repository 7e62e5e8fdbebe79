"""The benchmark's tracks and panels by name, known without JAX."""

_EVADERS = ("still", "hide", "E_any", "shielded:E_any")
_PURSUERS = {
    "full": ("pure-pursuit", "intercept", "pursuer", "shielded:pursuer"),
    "lidar": ("intercept", "search", "searching:pursuer", "shielded:searching:pursuer"),
    "team": ("pure-pursuit", "intercept", "pursuer", "shielded:pursuer"),
}
PANELS = {track: {"pursuer": pursuers, "evader": _EVADERS} for track, pursuers in _PURSUERS.items()}
"""By track: the players of either side that an agent of the other one meets. They never change: other panels are
another benchmark."""
SUITE, PART = "suite-v2", "held-out"
"""The arenas that are played in."""
ROUNDS = 2
"""Games in each arena against each opponent."""
