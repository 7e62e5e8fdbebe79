"""Policies: classical players, networks, shields; agents as files, and those that ship with the package."""
