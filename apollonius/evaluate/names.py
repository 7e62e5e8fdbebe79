"""The benchmark's tracks and panels by name, known without JAX."""

PANELS = {
    "full": {
        "pursuer": ("pure-pursuit", "intercept", "P_any", "shielded:P_any"),
        "evader": ("still", "hide", "E_any", "shielded:E_any"),
    },
    "lidar": {
        "pursuer": ("intercept", "search", "searching:P_any", "shielded:searching:P_any"),
        "evader": ("still", "hide", "E_any", "shielded:E_any"),
    },
    "team": {
        "pursuer": ("pure-pursuit", "intercept", "P_team", "shielded:P_team"),
        "evader": ("still", "hide", "E_any", "shielded:E_any"),
    },
}
"""By track: the players of either side that an agent of the other one meets. They never change: other panels are
another benchmark."""
SUITE, PART = "suite-v2", "held-out"
"""The arenas that are played in."""
ROUNDS = 2
"""Games in each arena against each opponent."""
