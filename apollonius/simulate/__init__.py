"""Robots with bodies: the same games in MuJoCo."""
