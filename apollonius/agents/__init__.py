"""Policies: classical players, networks, shields; agents as files, and those of the package."""
