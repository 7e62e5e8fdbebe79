"""Gymnasium, vector, PettingZoo and OpenSpiel environments."""
