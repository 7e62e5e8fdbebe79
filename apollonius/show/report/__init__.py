"""The report of a training run or a reproduction: one HTML file that needs no network."""
