"""Gymnasium, vector and PettingZoo environments."""
