"""The schemes of self-play by name. `prioritised-hard` is what `prioritised_hard.py` has as its `SCHEME`."""

SCHEMES = (
    "latest",
    "uniform",
    "prioritised-hard",
)
INSTEAD = {
    "alternating": "latest",
    "latest-80-20": "prioritised-hard",
    "prioritised-even": "prioritised-hard",
    "gated": "uniform",
    "psro": "uniform",
    "psro-hedge": "uniform",
    "league": "prioritised-hard",
}
"""Schemes that there were, and which to take instead; docs/self_play.md says why they went."""
