"""The schemes of self-play by name. `prioritised-hard` is what `prioritised_hard.py` has as its `SCHEME`."""

SCHEMES = (
    "latest",
    "uniform",
    "prioritised-hard",
)
