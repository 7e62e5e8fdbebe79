"""The panels: fixed opponents of each side, by the track of the benchmark."""

_EVADERS = ("still", "hide", "evader", "shielded:evader")
_PURSUERS = {
    "full": ("pure-pursuit", "intercept", "pursuer", "shielded:pursuer"),
    "lidar": ("intercept", "search", "searching:pursuer", "shielded:searching:pursuer"),
    "team": ("pure-pursuit", "intercept", "pursuer", "shielded:pursuer"),
}
PANELS = {track: {"pursuer": pursuers, "evader": _EVADERS} for track, pursuers in _PURSUERS.items()}
"""Opponents of each track by side; other panels are another benchmark."""
