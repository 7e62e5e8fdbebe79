"""Matches, counts, intervals, tournaments, regret. Never trains."""
