"""Checks of policies, observations and games of other packages: one line for each defect."""
