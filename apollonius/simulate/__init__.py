"""Robots with bodies: the same games, players and referee, with wheels, motors and friction simulated by MuJoCo."""
