"""Checks of policies, observations and games from outside the package: one line for each property
that they lack.
"""
